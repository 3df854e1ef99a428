"""Files and folders that appear whole or not at all: written beside their place, then renamed into it."""

import contextlib
import hashlib
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
        with system_errors(path):
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
        with system_errors(path):
            temporary.mkdir()
        yield temporary
        with system_errors(path):
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
    with system_errors(path):  # a name too long for the system
        if path.is_dir():
            raise InputError(f"{path}: is a folder; name the file to write")
        if suffix and path.suffix != suffix:
            raise InputError(f"{path}: the file's name must end in {suffix}")
        if not path.parent.is_dir():
            raise InputError(f"{path.parent}: there is no such folder")


def file_facts(path: Path) -> dict[str, Any]:
    """Name, path as given, size and SHA-256 of a file, which is read piece by piece.

    Raises:
        InputError: it cannot be read.
    """
    with system_errors(path, "read"), path.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
        size = os.fstat(file.fileno()).st_size
    return {"name": path.name, "path": str(path), "bytes": size, "sha256": digest}


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
def system_errors(path: Path, done: str = "written") -> Iterator[None]:
    """A block in which what the operating system refuses becomes one sentence: that ``path`` cannot be ``done``.

    Raises:
        InputError: it refuses something.
    """
    try:
        yield
    except OSError as error:
        raise InputError(f"{path}: cannot be {done} ({error.strerror or error})") from error
