"""What halving and doubling each chosen constant of the inference does to verdicts on kept sets.

    python benchmarks/sealed/run.py --part mixed --first 0 --draws 40 --out out/sealed --only simulate
    python benchmarks/sealed/sensitivity.py --out out/sealed --seeds 3 4 8      # --tables prints what there is

Rows are made once for each set; every constant is then changed in a process of its own, and the search runs by the
rows alone, without laws. What was done is kept, and skipped when the command is given again.
"""

from __future__ import annotations

import os
import sys
import traceback
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import tyro

from discrepancy import rules
from discrepancy.engine.diagnose import diagnose
from discrepancy.result.json import diagnosis_to_dict
from discrepancy.team.long.parts import parted
from discrepancy.team.rig import TeamRig
from discrepancy.team.tolerances import read_tolerances
from discrepancy.team.words import TeamWords
from estimator.estimate.payload import estimate_payload
from estimator.recording.parquet import read_recording
from sealed import store
from sealed.score import Scored, score
from sealed.sets import SealedSet

CONSTANTS = (
    "NAMED_NATS", "PRIOR_ODDS", "LEAST_SLAB", "SLAB_OCTAVES", "SPREAD_NUMBERS", "POWER_NUMBERS", "LEAST_POWER",
    "SCATTER_FACTOR", "CELL_NATS", "UNLISTED_NATS", "FRICTION_FORM_SHARE", "LAW_SHARE", "LISTED_ODDS", "INTERVALS",
    "EXCHANGED_NATS", "LEAST_PROBABILITY", "LITTLE_SHARE", "CLOSE_NATS", "HELD_FACTOR", "PLACE_SHARE", "REACH_NATS",
    "REACH_SHARE", "BENT_CHI2_PER_N", "STRAIGHTER", "STRAIGHT_BESIDE_CHI2_PER_N", "LEVEL_KINDS", "PULL_SE",
)  # fmt: skip
"""Those that are chosen, or derived from what is, and can change a verdict; the others are steps, guards and time."""
FACTORS = (0.5, 2.0)
AS_IS = ("", 1.0)
LABEL = "sensitivity"


@dataclass(frozen=True)
class Options:
    """Command line.

    Attributes:
        out: folder with kept sets, of ``run.py``; results go there.
        seeds: of the sets that are used; all that are kept if none is given.
        constants: that are changed; all if none is given.
        jobs: processes.
        tables: print what there is instead.
    """

    out: Path = Path("out/sealed")
    seeds: tuple[int, ...] = ()
    constants: tuple[str, ...] = CONSTANTS
    jobs: int = 1
    tables: bool = False


def changes(constants: Sequence[str]) -> Iterator[tuple[str, float]]:
    """Every constant and factor, the rules as they are first."""
    yield AS_IS
    yield from ((name, factor) for name in constants for factor in FACTORS)


def rows_of(request: SealedSet, out: Path) -> TeamRig:
    """The rig of a set."""
    recordings = [read_recording(path) for path in store.recordings_of(request, out)]
    estimate = estimate_payload(recordings, compare_masses=True, withhold=False)
    excluded = request.names if request.kind == "left-out" else ()
    return TeamRig.of(parted(recordings), estimate, read_tolerances(None), excluded, 1)


def judge(rig: TeamRig, request: SealedSet, change: tuple[str, float], out: Path) -> None:
    """Diagnose with one constant changed, and keep the result."""
    name, factor = change
    if name:
        setattr(rules, name, getattr(rules, name) * factor)
    result: dict[str, Any] = {"key": f"{request.key} {name} {factor:g}", "change": change, "error": None}
    result |= {"set": request.to_dict(), "truth": store.truth_of(request, out)}
    try:
        found = diagnose(rig, closed_loop=False, laws="never", odds=rules.PRIOR_ODDS)
        values = diagnosis_to_dict(found, found.rig, TeamWords(), None, None)
        result["verdict"] = {key: values[key] for key in ("verdict", "causes")}
    except Exception:
        result["error"] = traceback.format_exc()
    store.append(out / f"{LABEL}.jsonl", result)


def run(options: Options) -> None:
    """All sets and constants that have no result yet."""
    done = {line["key"] for line in store.read(options.out / f"{LABEL}.jsonl")}
    for request in store.kept(options.out):
        if options.seeds and request.seed not in options.seeds:
            continue
        todo = [c for c in changes(options.constants) if f"{request.key} {c[0]} {c[1]:g}" not in done]
        if not todo:
            continue
        rig, running = rows_of(request, options.out), set[int]()
        for change in todo:
            while len(running) >= options.jobs:
                running.discard(os.wait()[0])
            sys.stdout.flush()
            child = os.fork()
            if not child:
                try:
                    judge(rig, request, change, options.out)
                finally:
                    os._exit(0)
            running.add(child)
        for child in running:
            os.waitpid(child, 0)
        print(f"{request.key}: {len(todo)} verdicts", flush=True)


def tables(results: Sequence[dict[str, Any]]) -> str:
    """A row per constant and factor."""
    head = "| constant | value | whole sets right | effects named right | wrong causes | stated right of all | Brier |"
    out = [head, "|---|---|---|---|---|---|---|"]
    groups: dict[tuple[str, float], list[Scored]] = {}
    errors: dict[tuple[str, float], int] = {}
    for line in results:
        change = line["change"][0], float(line["change"][1])
        groups.setdefault(change, [])
        if line["error"]:
            errors[change] = errors.get(change, 0) + 1
        else:
            groups[change].append(score(line))
    for (name, factor), scored in sorted(groups.items()):
        hidden = [one for each in scored for one in each.scores if one.listed]
        stated = [pair for each in scored for pair in each.stated]
        brier = sum((p - right) ** 2 for p, right in stated) / max(len(stated), 1)
        value = f"{getattr(rules, name) * factor:g}" if name else ""
        out.append(
            f"| {name or 'as they are'} | {value} | {sum(one.whole for one in scored)} of {len(scored)} "
            f"| {sum(one.right for one in hidden)} of {len(hidden)} | {sum(len(one.extras) for one in scored)} "
            f"| {sum(right for _, right in stated)} of {len(stated)} | {brier:.3f} |"
            + (f" {errors[name, factor]} errors" if (name, factor) in errors else "")
        )
    return "\n".join(out)


def main(options: Options) -> None:
    """Run, or print what was run."""
    unknown = [name for name in options.constants if not isinstance(getattr(rules, name, None), float)]
    if unknown:
        raise SystemExit(f"--constants: {unknown[0]!r} is no number of discrepancy.rules")
    if not options.tables:
        run(options)
    print(tables(store.read(options.out / f"{LABEL}.jsonl")))


if __name__ == "__main__":
    main(tyro.cli(Options))
