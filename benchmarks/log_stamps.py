"""One healthy team, its trials logged with stamps of five kinds, converted, diagnosed: python benchmarks/log_stamps.py

Trials are simulated once, with half the time step that the diagnosis uses; encoders of 16 bits and torques in steps of
0.01 N m with as much noise are read at the stamps. Every log goes through ``mocobot convert``; the verdict is that of
the measurements alone, without the closed loop.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import tyro

from hidden.generator import TIMESTEP_S
from hidden.logger import Logger
from hidden.schedule import Schedule
from hidden.verdict import verdict_on
from mocobot_sim.scene.scene import build_team
from mocobot_sim.trial.trial import run_trial

ON_GRID = Logger()
STAMPS = {
    "on the grid": (ON_GRID, ON_GRID),
    "robots staggered by 3.7 ms": (Logger(stagger_s=0.0037),) * 2,
    "one trial converted with --rate 50": (Logger(converted_hz=50.0), ON_GRID),
    "both converted with --rate 50": (Logger(converted_hz=50.0),) * 2,
    "400 Hz to 100 Hz": (Logger(rate_hz=400.0),) * 2,
    "0.2 ms of jitter": (Logger(jitter_s=2e-4),) * 2,
}
"""How each of the two trials is logged."""


@dataclass(frozen=True)
class Options:
    """Command line.

    Attributes:
        payload: a shipped one.
        seed: of trajectories, jitter, noise and rounding.
    """

    payload: str = "b"
    seed: int = 0


def main(options: Options) -> None:
    """Print one row of the table for each kind of stamps."""
    rng = np.random.default_rng(options.seed)
    team = build_team(options.payload)
    commands = Schedule(randoms=1, vias=20, periodic_s=30.0, hold_s=None).trajectories(team, rng)
    trials = [
        run_trial(build_team(options.payload, timestep_s=TIMESTEP_S), command, trial_number=number)
        for number, command in enumerate(commands, start=1)
    ]
    print("| stamps of the log | verdict | chi2/n |\n|---|---|---|")
    for name, loggers in STAMPS.items():
        logged = [
            logger.recorded(trial, rng, f"trial {number}")
            for number, (logger, trial) in enumerate(zip(loggers, trials, strict=True), start=1)
        ]
        verdict = verdict_on(logged, closed_loop="never", laws="never")
        print(f"| {name} | {verdict['verdict']} | {verdict['after']:.3f} |", flush=True)


if __name__ == "__main__":
    main(tyro.cli(Options))
