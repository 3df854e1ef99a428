"""Commands that die, and places that cannot be written: is anything half-written, does the next run work?

    python benchmarks/soak.py --kills 40         kill -9 at random moments; counts go on where they stopped
    python benchmarks/soak.py --faults           a full disk and a read-only one (tmpfs, which needs root), two at once
    python benchmarks/soak.py --tables           what there is

Every command is run once undisturbed; whatever else it leaves behind must be nothing or the same bytes. A command that
goes on where it was interrupted may leave some of its files, and what it goes on with in ``partial``; the next run must
go on without being forced. The sources must stay as they are meanwhile, the commit included, which provenance names.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tyro

INPUTS = (
    "rec.parquet",
    "rec.truth.json",
    "static.parquet",
    "static.truth.json",
    "log.csv",
    "est.json",
    "other.json",
)
OURS = [sys.executable, "-m", "mocobot"]


@dataclass(frozen=True)
class Case:
    """A command that writes.

    Attributes:
        words: its arguments; ``{}`` stands for where it writes.
        same: whether it writes the same bytes every time.
        resumes: whether the next run goes on with what an interrupted one has done.
    """

    words: str
    same: bool = True
    resumes: bool = False


CASES = {
    "simulate": Case("simulate --payload b --vias 2 --seed 3 --out {}/out.parquet"),
    "simulate, several": Case("simulate --payload b --vias 2 --trials random,random --out-dir {}/out"),
    "estimate": Case("estimate rec.parquet static.parquet --out {}/out.json"),
    "convert": Case("convert rec.parquet {}/out.csv"),
    "convert back": Case("convert log.csv {}/out.parquet"),
    "convert to a bag": Case("convert rec.parquet {}/out"),
    "map": Case("map log.csv --out {}/out.toml"),
    "inspect": Case("inspect rec.parquet --json {}/out.json"),
    "compare": Case("compare est.json other.json --out {}/out"),
    "calibrate": Case("calibrate rec.parquet --out {}/out"),
    "report": Case("report . --out {}/out.html"),
    "replay": Case("replay rec.parquet --save {}/out.rrd", same=False),  # an id of the recording is drawn
    "watch": Case("watch rec.parquet static.parquet --out {}/out --jobs 1"),
    "diagnose": Case("diagnose rec.parquet static.parquet --no-closed-loop --jobs 1 --out {}/out"),
    "paper": Case("paper --payload b --preset nominal --trials 2 --jobs 1 --out {}/out", resumes=True),
}
SLOW = ("watch", "diagnose", "paper")
QUICK = tuple(name for name in CASES if name not in SLOW)
PARTIAL = "out/partial/"
"""What an interrupted run leaves for the next one."""


@dataclass(frozen=True)
class Options:
    """Command line.

    Attributes:
        kills: how many processes to kill in all, those of earlier runs counted.
        faults: try full and read-only disks, and two runs into one place, instead.
        tables: print the counts instead.
        cases: commands; the quick ones if none is named.
        seed: of the moments.
        out: where inputs and results are kept.
    """

    kills: int = 40
    faults: bool = False
    tables: bool = False
    cases: tuple[str, ...] = QUICK
    seed: int = 0
    out: Path = Path("out/soak")


def start(case: Case, inputs: Path, where: Path, *more: str) -> subprocess.Popen[str]:
    """The command, where its inputs are."""
    words = [word.format(where) for word in case.words.split()]
    return subprocess.Popen(
        [*OURS, *words, *more], cwd=inputs, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )


def ended(process: subprocess.Popen[str]) -> tuple[int, str]:
    """Exit code and standard error."""
    said = process.communicate()[1]
    return process.returncode, said.strip()


def left(where: Path) -> tuple[dict[str, str], int]:
    """Digest of every file that a command left, and how many temporary ones there are."""
    files = [path for path in sorted(where.rglob("*")) if path.is_file()]
    names = {path: path.relative_to(where).as_posix() for path in files}
    temporary = [path for path in files if ".tmp" in names[path] or ".old" in names[path]]
    return {
        names[path]: hashlib.sha256(path.read_bytes()).hexdigest() for path in files if path not in temporary
    }, len(temporary)


def whole(found: dict[str, str], reference: dict[str, str], case: Case) -> bool:
    """Whether nothing is there but what belongs there: single files each whole, a folder with all that is in it.

    Where a command resumes, some files will do.
    """
    if case.resumes:
        return found.items() <= reference.items()
    top = {name.split("/")[0] for name in found}
    expected = {name: digest for name, digest in reference.items() if name.split("/")[0] in top}
    return found == expected if case.same else set(found) == set(expected)


def make_inputs(folder: Path) -> None:
    """Recordings, a log and estimates to work on."""
    if all((folder / name).is_file() for name in INPUTS):
        return
    folder.mkdir(parents=True, exist_ok=True)
    for words in (
        "simulate --payload b --vias 8 --out rec.parquet --force",
        "simulate --payload b --trajectory static --out static.parquet --force",
        "convert rec.parquet log.csv --force",
        "estimate rec.parquet --out est.json --force",
        "estimate static.parquet --out other.json --force",
    ):
        subprocess.run([*OURS, *words.split()], cwd=folder, check=True, stdout=subprocess.DEVNULL)


@contextmanager
def fresh() -> Iterator[Path]:
    """A folder to write to, of the same name every time: provenance tells it."""
    here = Path(tempfile.gettempdir()) / f"mocobot-soak-{os.getpid()}"
    shutil.rmtree(here, ignore_errors=True)
    here.mkdir()
    try:
        yield here
    finally:
        shutil.rmtree(here, ignore_errors=True)


def undisturbed(case: Case, inputs: Path) -> tuple[dict[str, str], float]:
    """What the command writes, and how long it takes [s]."""
    with fresh() as where:
        begin = time.perf_counter()
        code, said = ended(start(case, inputs, where))
        if code:
            raise RuntimeError(f"{case.words}: {said}")
        return left(where)[0], time.perf_counter() - begin


def kill(name: str, inputs: Path, reference: dict[str, str], lasts_s: float, share: float) -> dict[str, Any]:
    """Kill one command after a share of its time, look, and run it again."""
    case = CASES[name]
    with fresh() as where:
        process = start(case, inputs, where)
        time.sleep(share * lasts_s)
        alive = process.poll() is None
        process.kill()
        ended(process)
        found, temporary = left(where)
        parts = [found.pop(name) for name in list(found) if name.startswith(PARTIAL)]
        goes_on = case.resumes and (parts or not found)
        code, said = ended(start(case, inputs, where, *(() if goes_on else ("--force",))))
        again, _ = left(where)
        good = code == 0 and set(again) == set(reference) and whole(again, reference, case)
        return {
            "case": name, "share": share, "killed": alive, "files": len(found), "parts": len(parts),
            "temporary": temporary,
            "whole": whole(found, reference, case), "again": good, "said": said[-300:] if code else "",
        }  # fmt: skip


@contextmanager
def mounted(options: str) -> Iterator[Path]:
    """A small disk in memory."""
    here = Path(tempfile.mkdtemp(prefix="mocobot-soak-"))
    subprocess.run(["mount", "-t", "tmpfs", "-o", options, "tmpfs", str(here)], check=True)
    try:
        yield here
    finally:
        subprocess.run(["umount", str(here)], check=True)
        here.rmdir()


def fill(path: Path) -> None:
    """Take all the room that a disk has."""
    try:
        with path.open("wb", buffering=0) as file:
            while True:
                file.write(bytes(1024))
    except OSError:
        return


def fault(name: str, inputs: Path, disk: str) -> dict[str, Any]:
    """A disk that is full, or cannot be written."""
    with mounted({"full": "size=16k", "read-only": "ro"}[disk]) as where:
        if disk == "full":
            fill(where / "filler")
        code, said = ended(start(CASES[name], inputs, where))
        if disk == "full":
            (where / "filler").unlink()
        found, temporary = left(where)
    good = code == 2 and len(said.splitlines()) == 1 and "Traceback" not in said
    return {
        "case": name, "fault": disk, "refused": good, "whole": not found and not temporary, "said": said[-300:],
        "code": code,
    }  # fmt: skip


def twice(name: str, inputs: Path, reference: dict[str, str]) -> dict[str, Any]:
    """Two at once into one place: each is right or refused, and what is there is whole."""
    with fresh() as where:
        both = [start(CASES[name], inputs, where) for _ in range(2)]
        codes, said = zip(*map(ended, both), strict=True)
        found, temporary = left(where)
    good = set(codes) <= {0, 2} and 0 in codes and not any("Traceback" in text for text in said)
    return {
        "case": name, "fault": "two at once", "refused": good, "code": list(codes), "said": " | ".join(said)[-300:],
        "whole": whole(found, reference, CASES[name]) and bool(found) and not temporary,
    }  # fmt: skip


def append(path: Path, result: dict[str, Any]) -> None:
    """Keep a result, and say it."""
    with path.open("a", encoding="utf-8") as file:
        file.write(json.dumps(result) + "\n")
    print(json.dumps(result), flush=True)


def read(path: Path) -> list[dict[str, Any]]:
    """All results."""
    return (
        [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()] if path.is_file() else []
    )


def table(results: Sequence[dict[str, Any]]) -> str:
    """Counts by command and fault."""
    rows: dict[tuple[str, str], Counter[str]] = {}
    for result in results:
        good = result["whole"] and result.get("again", result.get("refused"))
        row = rows.setdefault((result.get("fault", "kill -9"), result["case"]), Counter())
        row.update({"number": 1, "right": int(good), "killed": int(result.get("killed", False))})
        row["temporary"] += result.get("temporary", 0)
    lines = [
        "| fault | command | number | in mid-run | right | temporary files left |",
        "|---|---|---|---|---|---|",
    ]
    lines += [
        f"| {fault} | {name} | {row['number']} | {row['killed'] or ''} | {row['right']} | {row['temporary'] or ''} |"
        for (fault, name), row in sorted(rows.items())
    ]
    return "\n".join(lines)


def main(options: Options) -> None:
    """Run, or print what was run."""
    results = options.out / "results.jsonl"
    if options.tables:
        print(table(read(results)))
        return
    inputs = (options.out / "inputs").resolve()
    make_inputs(inputs)
    known: dict[str, tuple[dict[str, str], float]] = {}
    if options.faults:
        for name in options.cases:
            for disk in ("full", "read-only"):
                append(results, fault(name, inputs, disk))
            append(results, twice(name, inputs, undisturbed(CASES[name], inputs)[0]))
        return
    for number in range(sum("killed" in result for result in read(results)), options.kills):
        name = options.cases[number % len(options.cases)]
        known[name] = known.get(name) or undisturbed(CASES[name], inputs)
        share = float(np.random.default_rng([options.seed, number]).uniform(0.1, 1.1))
        append(results, kill(name, inputs, *known[name], share))


if __name__ == "__main__":
    main(tyro.cli(Options))
