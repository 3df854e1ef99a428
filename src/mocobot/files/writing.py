"""Files that are written whole or not at all."""

from __future__ import annotations

import contextlib
import json
import uuid
from pathlib import Path
from typing import Any

from estimator.errors import InputError


def check_target(path: Path) -> None:
    """Find out that a file cannot be written before the work is done whose result it would hold.

    Raises:
        InputError: the target is a folder, or its folder does not exist.
    """
    try:
        if path.is_dir():
            raise InputError(f"{path}: is a folder; name the file to write")
        if not path.parent.is_dir():
            raise InputError(f"{path.parent}: there is no such folder")
    except OSError as error:  # a name too long for the system
        raise InputError(f"{path}: cannot be written ({error.strerror or error})") from error


def write_text(path: Path, text: str) -> None:
    """Write through a temporary file beside the target.

    Raises:
        InputError: the target cannot be written.
    """
    temporary = path.parent / f".{uuid.uuid4().hex}.tmp"
    try:
        temporary.write_text(text, encoding="utf-8")
        temporary.replace(path)
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror or error})") from error
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)


def write_json(path: Path, values: dict[str, Any]) -> None:
    """Write strict JSON (no NaN) through a temporary file.

    Raises:
        InputError: the target cannot be written.
    """
    write_text(path, json.dumps(values, indent=1, allow_nan=False) + "\n")


def make_folder(path: Path) -> Path:
    """Create a folder and its parents.

    Raises:
        InputError: it cannot be created.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{path}: cannot be created ({error.strerror or error})") from error
    return path
