"""How well the motion tells the skew of the robots' clocks: python benchmarks/clock_skew.py

A random trial of payload (a) is simulated once and logged again and again, with new noise and 2 % of the samples lost.
Each robot's clock has an offset and a drift against that of the robot before. Logs go the way of any measured log.
"""

from __future__ import annotations

import numpy as np
import tyro

from hidden import Logger
from mocobot_logs.convert import Labels, convert
from mocobot_sim.scene.models import omnid_design
from mocobot_sim.scene.scene import build_team
from mocobot_sim.trial.trajectories import random_vias
from mocobot_sim.trial.trial import run_trial

CASES = ((0.0, 0.0), (1e-3, 0.0), (20e-3, 0.0), (0.0, 50e-6), (5e-3, 50e-6))
"""Offset at the start [s] and drift."""
LOST = 0.02
DRAWS = 10


def main() -> None:
    """Errors of offset and drift over draws, and how large they are in claimed standard errors."""
    scene = build_team("a")
    trial = run_trial(scene, random_vias(scene.wrist_home_b, np.random.default_rng(1), vias=80))
    robots, middle_s = np.arange(1, trial.robots), trial.time[-1] / 2
    for offset_s, drift in CASES:
        logger, errors, claims = Logger(offset_s=offset_s, drift=drift, drops=LOST), [], []
        for draw in range(DRAWS):
            log = logger.logged(trial, np.random.default_rng(draw))
            clock = convert(log, Labels(trial=trial.trial), omnid_design()).clocks.estimate
            true = robots * drift
            errors.append(
                (clock.offset_s[1:] - robots * (offset_s + drift * middle_s), clock.drift[1:] - true)
            )
            claims.append((clock.offset_se_s[1:], clock.drift_se[1:]))
        print(f"\n{1e3 * offset_s:g} ms and {1e6 * drift:g} ppm from robot to robot, {DRAWS} draws:")
        for what, unit, error, claim in zip(
            ("offset", "drift"),
            ("us", "ppm"),
            np.moveaxis(errors, 1, 0),
            np.moveaxis(claims, 1, 0),
            strict=True,
        ):
            print(
                f"  {what:6} [{unit}]: rms error {1e6 * _rms(error):.3f}, claimed {1e6 * _rms(claim):.3f}, "
                f"rms of error over claim {_rms(error / claim):.2f}"
            )


def _rms(x: np.ndarray) -> float:
    return float(np.sqrt(np.mean(x**2)))


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
