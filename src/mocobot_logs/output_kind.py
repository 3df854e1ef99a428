"""What a recording can be written as, by the name of the target."""

from pathlib import Path
from typing import Literal

from estimator.errors import InputError

Kind = Literal["parquet", "csv", "npz", "mcap", "sqlite3", "folder"]
SUFFIXES: dict[str, Kind] = {
    ".parquet": "parquet",
    ".csv": "csv",
    ".npz": "npz",
    ".mcap": "mcap",
    ".db3": "sqlite3",
    "": "folder",
}
"""What is written, by the target's suffix; a bag's folder has none."""


def output_kind(path: Path) -> Kind:
    """What a target is to hold.

    Raises:
        InputError: nothing is written under such a name.
    """
    kind = SUFFIXES.get(path.suffix.lower())
    if kind is None or not path.name:
        known = ", ".join(suffix for suffix in SUFFIXES if suffix)
        raise InputError(f"{path}: the name must end in one of {known}, or have no suffix (a bag's folder)")
    return kind
