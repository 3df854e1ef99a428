"""Result folders that appear whole or not at all."""

from __future__ import annotations

import contextlib
import os
import shutil
import uuid
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from estimator.errors import InputError


def check_folder(path: Path, inputs: Sequence[Path], is_ours: Callable[[Path], bool], what: str) -> None:
    """Find out that a folder cannot be written before the work is done whose result it would hold.

    Args:
        path: folder to be created or replaced.
        inputs: files that must not be lost.
        is_ours: whether an existing folder is an earlier result and nothing else.
        what: the kind of result, for messages.

    Raises:
        InputError: it is a file, or not empty and no such result, or holds an input, or is the current folder, or its
            parent does not exist.
    """
    real = Path(os.path.realpath(path))
    try:
        if not real.parent.is_dir():
            raise InputError(f"{path.parent}: there is no such folder")
        if real.exists() and not real.is_dir():
            raise InputError(f"{path}: is a file; name a folder to write")
        if real in (here := Path.cwd(), *here.parents):
            raise InputError(f"{path}: is the current folder, or above it; name a folder of its own")
        for entry in inputs:
            if real in Path(os.path.realpath(entry)).parents:
                raise InputError(f"{path}: holds {entry}, which would be lost; name another folder")
        if real.exists() and any(real.iterdir()) and not is_ours(real):
            raise InputError(f"{path}: exists and is not {what}; name a new folder")
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror or error})") from error


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


@contextmanager
def _as_input_error(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror or error})") from error
