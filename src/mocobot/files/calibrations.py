"""Calibrations as files: what ``mocobot calibrate`` writes and other commands take."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from estimator.calibrate.calibration import Calibration
from estimator.calibrate.json import calibration_from_dict, calibration_to_dict
from estimator.files import write_json
from estimator.strict import read_json

NAME = "calibration.json"
"""The file in the folder of ``mocobot calibrate --out``."""


def read_calibration(path: Path | str) -> Calibration:
    """Read a calibration.

    Args:
        path: its file, or the folder that ``mocobot calibrate --out`` wrote.

    Raises:
        InputError: the file cannot be read, or is not a whole calibration.
    """
    path = Path(path)
    file = path / NAME if path.is_dir() else path
    return calibration_from_dict(read_json(file, "a calibration"), str(file))


def write_calibration(
    path: Path, calibration: Calibration, made_with: Mapping[str, Any] | None = None
) -> None:
    """Write a calibration; the file appears whole or not at all.

    Args:
        path: the file.
        calibration: to be written.
        made_with: what ``mocobot.files.provenance.provenance`` says, or None.

    Raises:
        InputError: it cannot be written.
    """
    more = {} if made_with is None else {"provenance": dict(made_with)}
    write_json(path, calibration_to_dict(calibration) | more)
