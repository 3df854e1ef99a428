"""Speed of a simulated trial: against bare physics on the same model, and against real time, in seconds of CPU.

Bare physics: a Python loop over ``mj_step`` from the same start with the motors at their resting torque, reset
every simulated second so that the uncontrolled arms stay near home.
"""

from __future__ import annotations

import time

import mujoco
import numpy as np

from mocobot_sim.scene.scene import build_team
from mocobot_sim.scene.team_index import TeamIndex
from mocobot_sim.trial.assemble import assemble_at_home
from mocobot_sim.trial.trajectories import random_vias
from mocobot_sim.trial.trial import run_trial


def seconds_per_step_bare(payload: str, seconds: int = 10) -> float:
    """CPU time per step of a bare ``mj_step`` loop [s]."""
    scene = build_team(payload)
    model = scene.compile()
    data = mujoco.MjData(model)
    index = TeamIndex.of(model)
    spent = 0.0
    for _ in range(seconds):
        assemble_at_home(scene, model, data, index)
        start = time.process_time()
        for _ in range(1000):
            mujoco.mj_step(model, data)
        spent += time.process_time() - start
    return spent / (1000 * seconds)


def main() -> None:
    """Print the two ratios."""
    payload = "a"
    scene = build_team(payload)
    trajectory = random_vias(scene.wrist_home_b, np.random.default_rng(0), vias=20)
    run_trial(
        scene, random_vias(scene.wrist_home_b, np.random.default_rng(0), vias=1)
    )  # compile the controller
    trials, bares = [], []
    for _ in range(5):  # alternate, so that a slow spell of the machine hits both
        bares.append(seconds_per_step_bare(payload))
        start = time.process_time()
        run_trial(scene, trajectory)
        trials.append((time.process_time() - start) / (1000 * trajectory.duration_s))
    bare, trial = np.median(bares), np.median(trials)
    print(f"bare mj_step loop   {1e6 * bare:6.1f} us per 1 ms step")
    print(f"trial, all included {1e6 * trial:6.1f} us per 1 ms step")
    print(f"trial over bare     {np.median(np.array(trials) / bares):6.2f}")
    print(f"simulated over real {1e-3 / trial:6.1f}")


if __name__ == "__main__":
    main()
