"""Hide effects in simulated recordings, diagnose blind, count what was found.

Finished sets are kept in the output folder and skipped when the command is given again.
"""

from __future__ import annotations

import pprint
from dataclasses import dataclass, replace
from pathlib import Path

import tyro

from discrepancy.engine.diagnose import When
from hidden.campaign import run_tasks
from hidden.generator import TIMESTEP_S
from hidden.measure_limits import measure_limits
from hidden.notes import failures
from hidden.parts import Part, tasks
from hidden.store import read_results
from hidden.tables import tables
from hidden.verdict import Loop


@dataclass(frozen=True)
class Options:
    """Command line.

    Attributes:
        part: what to run.
        draws: sets per cause and size, or in all where there is neither.
        first: seed of the first draw.
        factors: sizes over the detection limit.
        causes: what to hide; all if none is given.
        background: tolerances besides.
        preset: sensors.
        jobs: processes.
        out: where recordings and results go.
        timestep_s: of the simulation [s]; the closed loop must not share its own, 0.001.
        again: repeat sets that were not found right.
        closed_loop: when to run the recorded commands again; ``undecided`` is where the rows leave two causes about
            equally likely.
        laws: when to look for laws that the catalogue lacks; ``auto`` is where something unlisted is left.
        tables: print the tables of all results instead.
        failures: print every set that was not found right instead.
        limits: measure the detection limits instead.
    """

    part: Part = "single"
    draws: int = 2
    first: int = 0
    factors: tuple[float, ...] = (4.0,)
    causes: tuple[str, ...] = ()
    background: bool = False
    preset: str = "nominal"
    jobs: int = 2
    out: Path = Path("out/hidden")
    timestep_s: float = TIMESTEP_S
    again: bool = False
    closed_loop: Loop = "always"
    laws: When = "auto"
    tables: bool = False
    failures: bool = False
    limits: bool = False


def main(options: Options) -> None:
    """Run, or print what was run."""
    if options.limits:
        pprint.pprint(measure_limits(options.jobs))
    elif options.tables:
        print(tables(read_results(options.out / "results.jsonl")))
    elif options.failures:
        print(failures(read_results(options.out / "results.jsonl")))
    else:
        chosen = tasks(
            options.part,
            range(options.first, options.first + options.draws),
            options.factors,
            options.causes,
            background=options.background,
            preset=options.preset,
        )
        chosen = [
            replace(task, request=replace(task.request, timestep_s=options.timestep_s)) for task in chosen
        ]
        run_tasks(
            chosen,
            options.out,
            options.jobs,
            again=options.again,
            closed_loop=options.closed_loop,
            laws=options.laws,
        )


if __name__ == "__main__":
    main(tyro.cli(Options))
