"""Recordings by their files, and what to do with a file of another format."""

import os
import shlex
from pathlib import Path

from estimator.errors import InputError
from estimator.recording.model import Recording
from estimator.recording.parquet import read_recording
from mocobot_logs.formats import FORMATS, is_recording, log_kind

KINDS = {
    "bag": "a ROS 2 bag",
    "csv": "a table of text",
    "npz": "an NPZ archive",
    "mat": "a MATLAB file",
    "lerobot": "of a LeRobot dataset",
    "parquet": "a Parquet file",
}
"""Words for what ``log_kind`` finds."""


def read(path: Path) -> Recording:
    """Read a recording.

    Raises:
        InputError: as ``read_recording``; for a log of another format it names the command that converts it.
    """
    try:
        return read_recording(path)
    except InputError:
        if path.is_file() and path.suffix == ".json":
            raise InputError(
                f"{path}: is a JSON file, not a recording of mocobot; recordings are .parquet files"
            ) from None
        if path.is_file() or path.is_dir():
            check_no_log(path)
        raise


def check_no_log(path: Path) -> None:
    """Say what to do with a file or folder that is a log of another format, or of no format that is read.

    Raises:
        InputError: it is.
    """
    try:
        kind = log_kind(path)
        if kind == "parquet" and is_recording(path):
            return
    except InputError:
        if path.is_dir() or path.suffix in (".parquet", ".json"):
            return  # not a log at all, or a damaged recording
        raise InputError(
            f"{path}: is not a recording of mocobot, and mocobot convert does not read its format; make it {FORMATS}"
        ) from None
    name = Path(os.path.realpath(path)).name or "log"  # "." and "/" have none
    target = path.parent / f"{name if path.is_dir() else path.stem}.parquet"
    if target == path:
        target = path.parent / f"{path.stem}_recording.parquet"
    raise InputError(
        f"{path}: is {KINDS[kind]}, not a recording of mocobot; use "
        f"mocobot convert {shlex.quote(str(path))} {shlex.quote(str(target))}"
    )
