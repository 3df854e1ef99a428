"""Hide effects in the arm, diagnose its logs blind, print tables.

    python benchmarks/arm/campaign.py --first 2000 --draws 20 --out DIR
    python benchmarks/arm/campaign.py --out DIR --tables

It goes on where it was stopped; every set is simulated and diagnosed in a process of its own, and its truth is opened
after the verdict.
"""

from __future__ import annotations

import json
import os
import sys
import time
import traceback
from dataclasses import dataclass
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import tyro
from discrepancy.serial.diagnosis import diagnose_serial

from arm import machine
from arm.sets import ArmSet, Kind, make
from arm.tables import misses, tables


@dataclass(frozen=True)
class Options:
    """Command line.

    Attributes:
        first: seed of the first set.
        draws: how many sets.
        kind: of all sets; follows from the seed where it is not given.
        factor: size of every effect over its limit; 2 to 8 in turn where it is not given.
        out: where results go.
        label: name of the results.
        jobs: processes.
        tables: print the tables of the results instead.
        misses: print every set that is not wholly right instead.
    """

    first: int = 0
    draws: int = 10
    kind: Kind | None = None
    factor: float | None = None
    out: Path = Path("out/arm")
    label: str = "results"
    jobs: int = 1
    tables: bool = False
    misses: bool = False


def main(options: Options) -> None:
    """Run, or print."""
    path = options.out / f"{options.label}.jsonl"
    results = (
        [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()] if path.is_file() else []
    )
    if options.tables or options.misses:
        print(tables(results) if options.tables else misses(results))
        return
    options.out.mkdir(parents=True, exist_ok=True)
    machine.nominal(options.out)
    done = {(r["seed"], r["kind"]) for r in results}
    running: set[int] = set()
    for seed in range(options.first, options.first + options.draws):
        request = ArmSet.of(seed, options.kind, options.factor)
        if (seed, request.kind) in done:
            continue
        while len(running) >= options.jobs:
            running.discard(os.wait()[0])
        sys.stdout.flush()
        child = os.fork()
        if not child:
            try:
                _one(request, options.out, path)
            finally:
                sys.stdout.flush()
                os._exit(0)
        running.add(child)
    for child in running:
        os.waitpid(child, 0)


def _one(request: ArmSet, folder: Path, path: Path) -> None:
    result: dict[str, Any] = {"seed": request.seed, "kind": request.kind, "error": None}
    try:
        made = make(request, folder)
        begun = time.process_time()
        found = diagnose_serial(machine.nominal(folder), [made.log], excluded=request.excluded)
        values = found.to_dict()
        left = {"evidence", "undecidable", "detection_limits", "provenance"}
        result["verdict"] = {key: value for key, value in values.items() if key not in left}
        result["cpu_s"] = time.process_time() - begun
        result["truth"] = made.truth
        said = f"{values['verdict']}, {result['cpu_s']:.1f} s of CPU"
    except Exception:  # one that fails must not end the campaign
        result["error"] = traceback.format_exc()
        said = result["error"].splitlines()[-1]
    line = (json.dumps(result) + "\n").encode()
    file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    os.write(file, line)
    os.close(file)
    print(f"{request.seed} {request.kind} {[f.name for f in request.forms]}: {said}", flush=True)


if __name__ == "__main__":
    main(tyro.cli(Options))
