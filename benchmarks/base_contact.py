"""How the settings of roller, contact and friction act on a released base: why they are what they are.

One Omnid, arm locked: a leg of 0.5 m forward, one sideways and one turn of 1 rad, each in 3 s, then ten seconds at
rest under a steady force of 20 N at the floor. Errors are true motion against odometry with the rollers' kinematics.

python benchmarks/base_contact.py
"""

from __future__ import annotations

import time
from dataclasses import replace

import mujoco
import numpy as np

from mocobot_sim.base.design import BaseDesign, base_design
from mocobot_sim.base.drive import BaseDrive, build_solo, compile_solo, drive_solo
from mocobot_sim.scene.omnid import FRICTION_RATIO
from mocobot_sim.scene.team_index import BaseIndex
from mocobot_sim.trial.trajectories import Leg, plan

LEGS = {"forward": (0.5, 0.0, 0.0), "sideways": (0.0, 0.5, 0.0), "turn": (0.0, 0.0, 1.0)}


def model_of(design: BaseDesign, ratio: float, timestep_s: float) -> mujoco.MjModel:
    """One Omnid with other settings."""
    root = build_solo(design, timestep_s)
    root.option.impratio = ratio
    return compile_solo(root)


def creep(model: mujoco.MjModel, design: BaseDesign) -> float:
    """Velocity under 20 N, after 6 s [m/s]."""
    data, index = mujoco.MjData(model), BaseIndex.of(model)
    mujoco.mj_forward(model, data)
    drive = BaseDrive(plan((0.0, 0.0, 0.0), [Leg((0.0, 0.0, 0.0), 1.0)], 0.0), design=design)
    drive.begin(model, data, 1000.0, 10)
    force, body = np.array([16.0, 12.0, 0.0]), index.chassis[0]
    at = index.poses(data)
    for tick in range(10000):
        data.xfrc_applied[body] = [*force, *np.cross([0.0, 0.0, -data.xipos[body, 2]], force)]
        drive.act(0)
        mujoco.mj_step(model, data, nstep=round(0.001 / model.opt.timestep))
        if tick == 5999:
            at = index.poses(data)
    return float(np.linalg.norm((index.poses(data) - at)[0, :2]) / 4.0)


def row(design: BaseDesign, ratio: float, timestep_s: float = 0.001) -> str:
    """One line of the table."""
    model = model_of(design, ratio, timestep_s)
    begin, cells = time.process_time(), []
    for to in LEGS.values():
        motion = plan((0.0, 0.0, 0.0), [Leg(to, 3.0, 0.5)], rest_s=0.3)
        log = drive_solo(model, BaseDrive(motion, design=design), motion.duration_s)
        k = int(np.argmax(np.abs(to)))
        error = 100.0 * (log.true - log.odometry)[-1, 0, k] / to[k]
        moving = slice(30, 330)
        cells.append(
            f"{error:+6.2f} % {1e3 * np.sqrt(np.mean(log.slip[moving] ** 2)):5.2f} {log.load[moving].min():4.0f} N"
        )
    spent = (time.process_time() - begin) / (3 * 3.8 / timestep_s)
    return " | ".join(
        [
            f"{1e3 * _give(model):5.2f} mm",
            *cells,
            f"{1e6 * creep(model, design):7.1f} um/s",
            f"{1e6 * spent:4.0f} us",
        ]
    )


def _give(model: mujoco.MjModel) -> float:
    """By how much the robot sinks into the floor at rest [m]."""
    data = mujoco.MjData(model)
    for _ in range(round(1.0 / model.opt.timestep)):
        mujoco.mj_step(model, data)
    return -float(data.qpos[BaseIndex.of(model).free_qpos[0] + 2])


def main() -> None:
    """Vary one setting at a time."""
    design = base_design()
    print(
        f"{'':34s} give at rest; per leg: error, slip rms [mm/s], least load; creep under 20 N; time per step"
    )
    cases = {"as shipped": (design, FRICTION_RATIO, 0.001)}
    for seconds in (0.004, 0.02):
        cases[f"contact time {1e3 * seconds:g} ms"] = (
            replace(design, contact_time_s=seconds),
            FRICTION_RATIO,
            0.001,
        )
    for ratio in (1.0, 10.0, 30.0):
        cases[f"friction ratio {ratio:g}"] = (design, ratio, 0.001)
    for half in (0.0405, 0.042):
        longer = replace(design, roller_half_length_m=half)
        cases[f"roller half length {1e3 * half:g} mm"] = (longer, FRICTION_RATIO, 0.001)
    nine = replace(design, rollers=9, roller_mass_kg=0.04, roller_half_length_m=0.0418)
    cases["9 rollers of 41.8 mm"] = (nine, FRICTION_RATIO, 0.001)
    cases["time step 0.25 ms"] = (design, FRICTION_RATIO, 0.00025)
    for name, case in cases.items():
        print(f"{name:34s} {row(*case)}", flush=True)


if __name__ == "__main__":
    main()
