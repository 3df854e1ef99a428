"""Recordings as CSV and NPZ: for other programs, and read back by ``open_log`` without a map."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv as pcsv

from estimator.arm.wrist_level import wrist_of
from estimator.errors import InputError
from estimator.files import whole_file
from estimator.recording.model import Recording
from mocobot_logs.log import Level
from mocobot_logs.table.arrays import METADATA_NAME

_ROWS = 10_000


def write_csv(recording: Recording, path: Path, level: Level = "joint") -> None:
    """Write a recording as CSV: a header, commas, the columns of docs/recording.md, every number to its last bit.

    A text table has no place for metadata; who reads it has to say trial, payload and design again.

    Args:
        recording: what to write.
        path: target; an existing file is replaced once the new one is complete.
        level: "joint" or "wrist".

    Raises:
        InputError: the target cannot be written, or some driven angles have no wrist position.
    """
    columns = replace(recording, metadata=replace(recording.metadata, level=level)).file_columns()
    table = pa.table({name: np.ascontiguousarray(values) for name, values in columns.items()})
    with whole_file(path) as temporary:
        pcsv.write_csv(table, temporary, pcsv.WriteOptions(batch_size=_ROWS, quoting_style="none"))


def write_npz(recording: Recording, path: Path, level: Level = "joint") -> None:
    """Write a recording as NPZ: ``time`` (Q,), then ``phi``, ``theta``, ``tau`` and ``ref`` of shape (Q, N, 3).

    At wrist level ``h`` and ``force`` take the place of phi and tau. ``mocobot`` holds the metadata as JSON text.

    Args:
        recording: what to write.
        path: target; an existing file is replaced once the new one is complete.
        level: "joint" or "wrist".

    Raises:
        InputError: as ``write_csv``.
    """
    arrays = {"time": recording.time, "phi": recording.phi, "theta": recording.theta, "tau": recording.tau}
    if level == "wrist":
        try:
            h, force = wrist_of(recording.phi, recording.tau, recording.metadata.design)
        except InputError as error:
            raise InputError(f"{recording.name}: {error}") from error
        arrays = {"time": recording.time, "h": h, "theta": recording.theta, "force": force}
    if recording.ref is not None:
        arrays["ref"] = recording.ref
    rows = {name: np.ascontiguousarray(array) for name, array in arrays.items()}  # readers stream rows
    rows[METADATA_NAME] = np.array(replace(recording.metadata, level=level).to_json())
    with whole_file(path) as temporary, temporary.open("wb") as file:
        np.savez(file, allow_pickle=False, **rows)
