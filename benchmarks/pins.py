"""Compare what two versions of mocobot compute: every number, key, exit code and refusal.

    PYTHONPATH=OLD/src python benchmarks/pins.py make out/pins-old --inputs out/pins
    PYTHONPATH=NEW/src python benchmarks/pins.py make out/pins-new --inputs out/pins
    python benchmarks/pins.py compare out/pins-old out/pins-new

The recordings in ``--inputs`` are simulated by whichever version comes first. ``--paper`` adds the paper's experiment.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import pyarrow.parquet as pq
import tyro

RECORDINGS = 20
KINDS = ("random", "periodic", "static", "random")
PRESETS = ("nominal", "uncalibrated", "ideal")
PAYLOADS = "abcd"
SHORT = {"random": ("--vias", "12"), "periodic": ("--duration", "12"), "static": ()}
RTOL = 1e-9
PROVENANCE = (
    "provenance",
    "made_with",
    "written",
    "seconds",
    "started",
    "commit",
    "version",
    "path",
    "file",
    "sha256",
)
"""Keys whose values differ from run to run."""
COMMANDS = (
    "watch", "paper", "estimate", "calibrate", "diagnose", "convert", "map", "replay", "inspect", "report", "compare",
    "campaign", "simulate", "effects",
)  # fmt: skip
REFUSED = (
    "estimate", "estimate nosuch.parquet", "estimate {rec} --cutoff-hz -1", "estimate {rec} --method best",
    "calibrate {rec} --known-mass x", "calibrate {rec} --prior nosuch.toml", "diagnose {rec} --exclude nothing",
    "diagnose {rec} --odds 2", "diagnose {rec} --seconds -1", "diagnose {rec} --model nosuch.xml",
    "inspect {rec} --map nosuch", "inspect {dir}", "map {rec} --episode 3", "convert {rec} {rec}",
    "convert {rec} new.xyz", "convert {rec} new.csv --rate 0", "convert {rec} new.csv --crop 5", "report {dir}",
    "compare {rec} {rec}", "simulate", "simulate --out new.parquet --payload nosuch",
    "simulate --out new.parquet --effect sea_bias:robot=9", "simulate --out new.parquet --effect nosuch:x=1",
    "paper --trials 0", "campaign --draws 0", "replay nosuch.parquet", "watch nosuch.parquet", "nosuch",
)  # fmt: skip


@dataclass(frozen=True)
class Make:
    """Run the commands of the version that is imported, and keep their results.

    Attributes:
        out: folder for the results.
        inputs: folder of the recordings; they are simulated where it is missing.
        paper: whether to run the paper's experiment, too.
    """

    out: Annotated[Path, tyro.conf.Positional]
    inputs: Path
    paper: bool = False


@dataclass(frozen=True)
class Compare:
    """Print what differs between two folders of results.

    Attributes:
        before, after: folders.
    """

    before: Annotated[Path, tyro.conf.Positional]
    after: Annotated[Path, tyro.conf.Positional]


def main(options: Make | Compare) -> int:
    """Run one of the two; the exit code tells whether anything differs."""
    if isinstance(options, Make):
        _make(options)
        return 0
    lines = list(_differences(options.before, options.after))
    print("\n".join(lines[:200]) or "nothing differs")
    return int(bool(lines))


def _run(folder: Path, name: str, *arguments: object) -> None:
    """Run one command, and keep its exit code and the sentence of a refusal."""
    environment = {**os.environ, "COLUMNS": "100", "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, "-m", "mocobot", *map(str, arguments)], capture_output=True, text=True, env=environment,
    )  # fmt: skip
    said = done.stderr.replace(str(folder), "OUT") if done.returncode == 2 else ""
    (folder / f"{name}.exit.json").write_text(json.dumps({"exit": done.returncode, "said": said}))
    print(name, done.returncode, flush=True)


def _inputs(folder: Path) -> list[Path]:
    recordings = [folder / f"rec{k:02d}.parquet" for k in range(RECORDINGS)]
    folder.mkdir(parents=True, exist_ok=True)
    for k, path in enumerate(recordings):
        if not path.exists():
            kind = KINDS[k % len(KINDS)]
            _run(
                folder, f"simulate{k:02d}", "simulate", "--out", path, "--seed", k, "--trajectory", kind,
                "--payload", PAYLOADS[k % 4], "--preset", PRESETS[k % 3], *SHORT[kind],
            )  # fmt: skip
    return recordings


def _make(options: Make) -> None:
    recordings, out = _inputs(options.inputs), options.out
    out.mkdir(parents=True)
    for k, path in enumerate(recordings):
        _run(out, f"estimate{k:02d}", "estimate", path, "--out", out / f"estimate{k:02d}.json")
        _run(out, f"inspect{k:02d}", "inspect", path, "--json", out / f"inspect{k:02d}.json")
        log = out / f"log{k:02d}{('.csv', '.npz', '.mcap', '.db3')[k % 4]}"
        _run(out, f"export{k:02d}", "convert", path, log)
        back = out / f"back{k:02d}.parquet"
        _run(out, f"convert{k:02d}", "convert", log, back, "--json", out / f"convert{k:02d}.json")
        _hash(back, out / f"back{k:02d}.sha.json")
        log.unlink(missing_ok=True)
        back.unlink(missing_ok=True)
    of_one = recordings[1::12]  # one team and payload, out of the box
    for method in ("fit", "staged", "joint"):
        _run(out, method, "estimate", recordings[0], "--method", method, "--out", out / f"{method}.json")
    _run(out, "calibrate", "calibrate", *of_one, "--out", out / "calibrate")
    _run(out, "again", "simulate", "--out", out / "again.parquet", "--vias", 6)
    _hash(out / "again.parquet", out / "again.sha.json")
    for command in COMMANDS:
        _run(out, f"help_{command}", command, "--help")
    for k, line in enumerate(REFUSED):
        _run(out, f"refused{k:02d}", *line.format(rec=recordings[0], dir=options.inputs).split())
    if options.paper:
        _run(out, "paper", "paper", "--seed", 0, "--out", out / "paper")


def _hash(recording: Path, out: Path) -> None:
    """The samples of a recording as one hash."""
    digest = hashlib.sha256()
    if recording.exists():
        table = pq.read_table(recording)
        for name in table.column_names:
            digest.update(name.encode())
            digest.update(repr(table.column(name).to_pylist()).encode())
    out.write_text(json.dumps({"samples": digest.hexdigest()}))


def _differences(before: Path, after: Path) -> Iterator[str]:
    names = {str(p.relative_to(d)) for d in (before, after) for p in d.rglob("*.json")}
    for name in sorted(names):
        pair = [d / name for d in (before, after)]
        if not all(p.exists() for p in pair):
            yield f"{name}: only {'before' if pair[0].exists() else 'after'}"
        else:
            yield from _unlike(*(json.loads(p.read_text()) for p in pair), name)


def _unlike(a: Any, b: Any, where: str) -> Iterator[str]:
    if isinstance(a, dict) and isinstance(b, dict):
        for key in sorted(a.keys() | b.keys()):
            if key in PROVENANCE:
                continue
            if key in a and key in b:
                yield from _unlike(a[key], b[key], f"{where} {key}")
            else:
                yield f"{where} {key}: only {'before' if key in a else 'after'}"
    elif isinstance(a, list) and isinstance(b, list) and len(a) == len(b):
        for k, (x, y) in enumerate(zip(a, b, strict=True)):
            yield from _unlike(x, y, f"{where}[{k}]")
    elif isinstance(a, float) and isinstance(b, float):
        if not math.isclose(a, b, rel_tol=RTOL, abs_tol=1e-15):
            yield f"{where}: {a} {b}"
    elif a != b and not _same_file(a, b):
        yield f"{where}: {a!r} {b!r}"


def _same_file(a: Any, b: Any) -> bool:
    """Whether both are absolute paths with one name."""
    strings = isinstance(a, str) and isinstance(b, str)
    return strings and Path(a).is_absolute() and Path(a).name == Path(b).name


if __name__ == "__main__":
    sys.exit(main(tyro.cli(Make | Compare)))
