"""Speed of released bases: steps of physics with rollers and without, one robot and a team, in processor time.

python benchmarks/speed/base.py
"""

from __future__ import annotations

import time

import mujoco
import numpy as np

from mocobot_sim.base.drive import BaseDrive, build_solo, compile_solo
from mocobot_sim.control.control import ControlGains, TeamController
from mocobot_sim.scene.models import omnid_design
from mocobot_sim.scene.scene import build_team
from mocobot_sim.scene.team_index import TeamIndex
from mocobot_sim.trial.assemble import assemble_at_home
from mocobot_sim.trial.trajectories import Leg, carried, plan, yaw_of

STEPS = 3000


def team(released: bool) -> tuple[float, float, int]:
    """Processor time per step [s] of the physics alone and with control and drives; degrees of freedom."""
    scene = build_team("a", released=released)
    model = scene.compile()
    data, index = mujoco.MjData(model), TeamIndex.of(model)
    assemble_at_home(scene, model, data, index)
    controller = TeamController(index, omnid_design(), ControlGains(), data)
    drive = None
    if released:
        places = np.column_stack([scene.mounts.translation[:, :2], yaw_of(scene.mounts.rotation.as_matrix())])
        motion = carried(plan((0.0, 0.0, 0.0), [Leg((0.0, 0.5, 0.3), 3.0)], 0.0), places)
        drive = BaseDrive(motion)
        drive.begin(model, data, 1000.0, 10)
    physics = begin = 0.0
    for tick in range(STEPS + 200):
        if tick == 200:  # once compiled and settled
            physics, begin = 0.0, time.process_time()
        controller.update(scene.wrist_home_b, np.zeros_like(scene.wrist_home_b))
        if drive:
            drive.act(tick)
        before = time.process_time()
        mujoco.mj_step(model, data)
        physics += time.process_time() - before
    return physics / STEPS, (time.process_time() - begin) / STEPS, model.nv


def solo() -> tuple[float, float, int]:
    """The same of one Omnid with a locked arm."""
    model = compile_solo(build_solo())
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    drive = BaseDrive(plan((0.0, 0.0, 0.0), [Leg((0.0, 0.8, 1.0), 3.0)], 0.0))
    drive.begin(model, data, 1000.0, 10)
    physics = begin = 0.0
    for tick in range(STEPS + 200):
        if tick == 200:
            physics, begin = 0.0, time.process_time()
        drive.act(tick)
        before = time.process_time()
        mujoco.mj_step(model, data)
        physics += time.process_time() - before
    return physics / STEPS, (time.process_time() - begin) / STEPS, model.nv


def main() -> None:
    """Print a table."""
    print("                                        dofs   physics     all   steps/s   simulated/real")
    for name, (physics, everything, nv) in (
        ("one Omnid on rollers, arm locked", solo()),
        ("three Omnids, payload (a), parked", team(False)),
        ("three Omnids, payload (a), on rollers", team(True)),
    ):
        print(
            f"{name:38s} {nv:5d} {1e6 * physics:7.0f} us {1e6 * everything:5.0f} us"
            f" {1.0 / everything:9.0f} {1e-3 / everything:9.1f}"
        )


if __name__ == "__main__":
    main()
