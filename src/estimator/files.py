"""Files and folders that appear whole or not at all: written beside their place, then renamed into it."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import uuid
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from estimator.errors import InputError


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A temporary name beside ``path`` for a file that takes its place when the block ends without an error.

    Raises:
        InputError: the operating system refuses.
    """
    real = Path(os.path.realpath(path))
    temporary = real.parent / f".{uuid.uuid4().hex}.tmp"
    try:
        with _as_input_error(path):
            yield temporary
            temporary.replace(real)
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)


@contextmanager
def whole_folder(path: Path) -> Iterator[Path]:
    """A temporary folder that takes the place of ``path`` (with all it held) when the block ends without an error.

    Raises:
        InputError: it cannot be created or put in place.
    """
    real = Path(os.path.realpath(path))
    mark = uuid.uuid4().hex
    temporary, old = real.parent / f".{mark}.tmp", real.parent / f".{mark}.old"
    try:
        with _as_input_error(path):
            temporary.mkdir()
        yield temporary
        with _as_input_error(path):
            if real.exists():
                real.rename(old)
            temporary.rename(real)
    finally:
        if old.exists() and not real.exists():
            with contextlib.suppress(OSError):
                old.rename(real)
        shutil.rmtree(temporary, ignore_errors=True)
        if real.exists():
            shutil.rmtree(old, ignore_errors=True)


def check_target(path: Path, suffix: str = "") -> None:
    """Find out that a file cannot be written before the work is done whose result it would hold.

    Args:
        path: the file.
        suffix: how its name must end, ``".html"`` for example; any name will do if empty.

    Raises:
        InputError: the target is a folder, its name ends otherwise, or its folder does not exist.
    """
    try:
        if path.is_dir():
            raise InputError(f"{path}: is a folder; name the file to write")
        if suffix and path.suffix != suffix:
            raise InputError(f"{path}: the file's name must end in {suffix}")
        if not path.parent.is_dir():
            raise InputError(f"{path.parent}: there is no such folder")
    except (OSError, ValueError) as error:  # a name too long for the system, or with a NUL
        raise InputError(
            f"{path}: cannot be written ({getattr(error, 'strerror', None) or error})"
        ) from error


def write_text(path: Path, text: str) -> None:
    """Write UTF-8 text.

    Raises:
        InputError: the target cannot be written.
    """
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def write_json(path: Path, values: Mapping[str, Any]) -> None:
    """Write strict JSON (no NaN).

    Raises:
        InputError: the target cannot be written.
    """
    write_text(path, json.dumps(values, indent=1, allow_nan=False) + "\n")


@contextmanager
def _as_input_error(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror or error})") from error
