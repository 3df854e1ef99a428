"""Calibrate simulated teams of uncalibrated robots from what they carry, and compare with the truth.

    python benchmarks/calibrate_teams.py --part main --seeds 300 301 302 303 --jobs 2
    python benchmarks/calibrate_teams.py --tables

Recordings and results are kept in the output folder; finished ones are skipped when a command is given again.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import tyro

from calibration.campaign import run_tasks, tasks
from calibration.tables import tables
from sealed.store import read

Part = Literal["main", "prior", "weighed", "transfer", "masses", "tilt", "robots", "nominal"]


@dataclass(frozen=True)
class Options:
    """Command line.

    Attributes:
        part: what to run: estimates and calibrations of uncalibrated teams; priors three times too narrow and too wide;
            one known weight; robots calibrated on payload (a); arm masses off by 5 %; bases that do not stand level;
            teams of other sizes; robots as designed.
        seeds: one team of robots each.
        payloads: what each carries.
        robots: sizes of the teams of part "robots".
        jobs: processes.
        out: where recordings and results go.
        tables: print the tables of all results instead.
    """

    part: tuple[Part, ...] = ("main",)
    seeds: tuple[int, ...] = (300,)
    payloads: tuple[str, ...] = ("a", "b", "c", "d")
    robots: tuple[int, ...] = (2, 5, 10)
    jobs: int = 2
    out: Path = Path("out/calibration")
    tables: bool = False


def main(options: Options) -> None:
    """Run, or print what was run."""
    if options.tables:
        print(tables(read(options.out / "results.jsonl")))
        return
    listed = [
        task for part in options.part for task in tasks(part, options.seeds, options.payloads, options.robots)
    ]
    run_tasks(listed, options.out, options.jobs)


if __name__ == "__main__":
    main(tyro.cli(Options))
