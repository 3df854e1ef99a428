"""Sets and results on disk: recordings and truth in a folder each, results as one JSON line each."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path
from typing import Any

from estimator.recording.parquet import write_recording
from hidden.schedule import Schedule
from sealed.sets import SealedSet, generate


def folder_of(request: SealedSet, out: Path) -> Path:
    """Where a set is kept."""
    return out / "sets" / request.key


def is_simulated(request: SealedSet, out: Path) -> bool:
    """Whether it is there, whole."""
    return (folder_of(request, out) / "truth.json").is_file()


def simulate(request: SealedSet, out: Path) -> dict[str, Any]:
    """Simulate a set, and keep its recordings and its truth.

    Raises:
        TrialError: the physics of a trial cannot be trusted.
    """
    here = folder_of(request, out)
    here.mkdir(parents=True, exist_ok=True)
    recordings, truth = generate(request)
    for number, recording in enumerate(recordings, start=1):
        write_recording(recording, here / f"trial{number}.parquet")
    content = {"request": request.to_dict(), "truth": truth}
    temporary = here / "truth.tmp"
    temporary.write_text(json.dumps(content, indent=1), encoding="utf-8")
    os.replace(temporary, here / "truth.json")  # last: a folder with a truth is complete
    return truth


def kept(out: Path) -> list[SealedSet]:
    """Every set that is there, whole, by seed."""
    requests = []
    for path in sorted((out / "sets").glob("*/truth.json")):
        values = json.loads(path.read_text(encoding="utf-8"))["request"]
        values["schedule"] = Schedule(**values["schedule"])
        values |= {name: tuple(values[name]) for name in ("names", "factors")}
        requests.append(SealedSet(**values))
    return sorted(requests, key=lambda request: request.seed)


def recordings_of(request: SealedSet, out: Path) -> list[Path]:
    """Files of its trials, in order."""
    return sorted(folder_of(request, out).glob("trial*.parquet"))


def truth_of(request: SealedSet, out: Path) -> dict[str, Any]:
    """What was hidden.

    Raises:
        ValueError: the folder belongs to another request.
    """
    path = folder_of(request, out) / "truth.json"
    content = json.loads(path.read_text(encoding="utf-8"))
    if content["request"] != json.loads(json.dumps(request.to_dict())):
        raise ValueError(f"{path} belongs to another request; delete its folder or choose another one")
    return content["truth"]


def forget(request: SealedSet, out: Path) -> None:
    """Delete its recordings; the truth stays with the results."""
    shutil.rmtree(folder_of(request, out))


def append(path: Path, result: dict[str, Any]) -> None:
    """Add one line; a line is written whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    try:
        os.write(descriptor, (json.dumps(result) + "\n").encode())
    finally:
        os.close(descriptor)


def read(path: Path) -> list[dict[str, Any]]:
    """All results; of a set that was repeated, the last."""
    if not path.is_file():
        return []
    lines = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
    return list({(line.get("part"), line["key"]): line for line in lines}.values())
