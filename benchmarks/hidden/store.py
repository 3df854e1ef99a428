"""Finished sets: recordings and truth in a folder each, results as one JSON line each."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from estimator.recording.model import Recording
from estimator.recording.parquet import read_recording, write_recording
from hidden.generator import HiddenSet, generate
from hidden.sealed import Sealed


def recordings_of(request: HiddenSet, folder: Path) -> tuple[list[Recording], Sealed]:
    """Recordings and sealed truth of a set, simulated unless they are in its folder already."""
    here = folder / request.key
    if not (here / "truth.json").is_file():
        here.mkdir(parents=True, exist_ok=True)
        recordings, sealed = generate(request)
        for number, recording in enumerate(recordings, start=1):
            write_recording(recording, here / f"trial{number}.parquet")
        sealed.save(here / "truth.json", request.to_dict())  # last: a folder with a truth is complete
    recordings = [read_recording(path) for path in sorted(here.glob("trial*.parquet"))]
    return recordings, Sealed.load(here / "truth.json", request.to_dict())


def append_result(path: Path, result: Mapping[str, Any]) -> None:
    """Add one line; a line is written whole or not at all."""
    line = (json.dumps(result) + "\n").encode()
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    try:
        os.write(descriptor, line)
    finally:
        os.close(descriptor)


def read_results(path: Path) -> list[dict[str, Any]]:
    """All results; of a set that was repeated, the last."""
    if not path.is_file():
        return []
    lines = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
    return list({(line["part"], line["key"]): line for line in lines}.values())
