"""Parquet files whose beginning or end is missing: told from a few bytes, without the library that reads the rest."""

import os
from pathlib import Path

from estimator.errors import InputError
from mocobot_logs.formats import PARQUET as MAGIC

LEAST_BYTES = 12
"""Both, and the length of the footer between them."""


def check_parquet(path: Path) -> None:
    """Find out that a file is an empty or a cut Parquet file; whatever does not look like one is let pass.

    Raises:
        InputError: it is.
    """
    try:
        with path.open("rb") as file:
            head = file.read(len(MAGIC))
            size = file.seek(0, os.SEEK_END)
            file.seek(-min(size, len(MAGIC)), os.SEEK_END)
            end = file.read()
    except (OSError, ValueError):
        return  # a folder, or what may not be read: reading tells
    if head != MAGIC and (size or path.suffix.lower() != ".parquet"):
        return
    if size < LEAST_BYTES or end != MAGIC:
        what = f"Parquet file size is {size} bytes" if size < LEAST_BYTES else "its end is missing"
        raise InputError(f"{path}: not a readable Parquet file, or a damaged one ({what})")
