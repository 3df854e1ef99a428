"""The sealed campaign: simulate sets, diagnose them blind, print the tables.

    python benchmarks/sealed/run.py --part PART --first SEED --draws N
    python benchmarks/sealed/run.py --tables                                # or --misses

Parts are ``single``, ``pairs``, ``clean``, ``triples``, ``forms`` (other than the catalogue's), ``unlisted``,
``sliding`` (stiction and play), ``uncalibrated`` (one fault in a team that nobody calibrated), ``logs`` (healthy, by
any lab's logger and ``mocobot convert``), ``long`` (an hour), and those of ``sealed.sets``.

Sets and results are kept in the output folder, and skipped when the command is given again. Recordings and truth
stay, so that engines can be compared on the same ones: give each a ``--label``. Simulations and diagnoses are steps of
their own (``--only``), each set in a process of its own with a limit of CPU time.

Singles are worth 30 nats and more to an oracle that knows the rest: at its limit a cause gains 38 of chi-square, so one
of two limits, the least that is drawn, gains 76 nats.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
# As mocobot does, which is imported too late here: threads that share small matrices only wait for each other.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import tyro

from sealed import sets
from sealed.campaign import How, diagnose_all, simulate_all, simulate_and_diagnose
from sealed.limits import Background
from sealed.sets import TIMESTEP_S, Kind, SealedSet, plan
from sealed.tables import misses, tables

MIXED: tuple[Kind, ...] = (
    "clean", "single", "forms", "single", "pairs", "single", "clean", "single", "forms", "single",
)  # fmt: skip
"""Kinds of successive seeds of a mixed part."""


@dataclass(frozen=True)
class Options:
    """Command line.

    Attributes:
        part: what is hidden; ``mixed`` takes kinds in turn.
        draws: how many sets.
        first: seed of the first.
        out: where recordings and results go.
        jobs: processes.
        only: simulate or diagnose only.
        kept: diagnose every set that is in the folder, whatever its seed.
        label: name of the results.
        background: the robots; drawn if not given.
        factors: sizes over the limit, in turn; drawn if none is given.
        names: causes or forms, in turn; drawn if none is given.
        timestep_ms: integration step.
        cpu_s: CPU time after which a diagnosis is given up [s].
        closed_loop: run the recorded commands again.
        keep: keep the recordings of diagnosed sets.
        tables: print the tables of the results instead.
        misses: print every set that is not wholly right instead.
        list: print what the sets are instead.
    """

    part: Kind | Literal["mixed", "uncalibrated"] = "mixed"
    draws: int = 10
    first: int = 0
    out: Path = Path("out/sealed")
    jobs: int = 1
    only: Literal["both", "simulate", "diagnose"] = "both"
    kept: bool = False
    label: str = "results"
    background: Background | None = None
    factors: tuple[float, ...] = ()
    names: tuple[str, ...] = ()
    timestep_ms: float = 1e3 * TIMESTEP_S
    cpu_s: int = 600
    closed_loop: bool = True
    keep: bool = True
    tables: bool = False
    misses: bool = False
    list: bool = False


def planned(options: Options) -> Sequence[SealedSet]:
    """The sets of a command."""
    out = []
    for k, seed in enumerate(range(options.first, options.first + options.draws)):
        kind: Kind = "single"
        if options.part == "mixed":
            kind = MIXED[seed % len(MIXED)]
        elif options.part != "uncalibrated":
            kind = options.part
        background = "uncalibrated" if options.part == "uncalibrated" else options.background
        factor = options.factors[k % len(options.factors)] if options.factors else None
        name = (
            options.names[k // max(len(options.factors), 1) % len(options.names)] if options.names else None
        )
        name = None if kind == "clean" else name
        out.append(plan(kind, seed, background, factor, name, options.timestep_ms / 1e3))
    return out


def main(options: Options) -> None:
    """Run, or print what was run."""
    how = How(options.out, options.label, options.jobs, options.cpu_s, options.closed_loop, options.keep)
    if options.tables or options.misses:
        print((tables if options.tables else misses)(sets.read(how.path)))
        return
    requests = sets.kept(options.out) if options.kept else planned(options)
    if options.list:
        print("\n".join(request.key for request in requests))
    elif options.only == "simulate":
        simulate_all(requests, how)
    else:
        (diagnose_all if options.only == "diagnose" else simulate_and_diagnose)(requests, how)


if __name__ == "__main__":
    main(tyro.cli(Options))
