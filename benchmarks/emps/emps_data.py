"""Where the EMPS benchmark's recordings are; they are not part of this repository."""

from __future__ import annotations

import os
from pathlib import Path

VARIABLE = "MOCOBOT_EMPS_DATA"
DATA, PULSES = "DATA_EMPS.mat", "DATA_EMPS_PULSES.mat"
FOLDER = Path(__file__).resolve().parents[2] / "data" / "emps"


def data_folder() -> Path | None:
    """The folder with both recordings: from the environment, or ``data/emps`` in the repository."""
    folder = Path(os.environ.get(VARIABLE) or FOLDER)
    return folder if all((folder / name).is_file() for name in (DATA, PULSES)) else None


def needed_folder() -> Path:
    """The folder, or a message and the end of the program."""
    folder = data_folder()
    if folder is None:
        raise SystemExit(
            f"{DATA} and {PULSES} of nonlinearbenchmark.org are needed: set {VARIABLE} to their folder ({FOLDER} has "
            "none)"
        )
    return folder
