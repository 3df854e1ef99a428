"""Files and folders that appear whole or not at all: written beside their place, then renamed into it."""

import contextlib
import errno
import hashlib
import json
import os
import shutil
import tempfile
import uuid
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from estimator.errors import InputError

FULL = (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EIO)
"""What a disk says that takes no more."""


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A temporary name beside ``path`` for a file that takes its place when the block ends without an error.

    Missing folders above it are made.

    Raises:
        InputError: the operating system refuses.
    """
    real = Path(os.path.realpath(path))
    temporary = real.parent / f".{uuid.uuid4().hex}.tmp"
    with system_errors(path), _folders_above(path):
        try:
            yield temporary
            temporary.replace(real)
        finally:
            with contextlib.suppress(OSError):
                temporary.unlink(missing_ok=True)


@contextmanager
def whole_folder(path: Path) -> Iterator[Path]:
    """A temporary folder that takes the place of ``path`` (with all it held) when the block ends without an error.

    Missing folders above it are made. What cannot be written inside is told by its place in ``path``.

    Raises:
        InputError: it cannot be created or put in place.
    """
    real = Path(os.path.realpath(path))
    mark = uuid.uuid4().hex
    temporary, old = real.parent / f".{mark}.tmp", real.parent / f".{mark}.old"
    with _folders_above(path):
        try:
            with system_errors(path):
                temporary.mkdir()
            yield temporary
            with system_errors(path):
                if real.exists():
                    real.rename(old)
                temporary.rename(real)
        except InputError as error:
            if str(temporary) not in str(error):
                raise
            raise InputError(str(error).replace(str(temporary), str(path))) from error
        except OSError as error:  # of libraries that write pictures
            if error.errno not in FULL:
                raise
            raise InputError(f"{path}: cannot be written ({error.strerror})") from error
        finally:
            if old.exists() and not real.exists():
                with contextlib.suppress(OSError):
                    old.rename(real)
            shutil.rmtree(temporary, ignore_errors=True)
            if real.exists():
                shutil.rmtree(old, ignore_errors=True)


@contextmanager
def _folders_above(path: Path) -> Iterator[None]:
    """A block before which the missing folders above ``path`` are made, and taken away again if it fails."""
    real = Path(os.path.realpath(path))
    missing = [folder for folder in real.parents if not folder.exists()]
    try:
        with system_errors(path):
            real.parent.mkdir(parents=True, exist_ok=True)
        yield
    except BaseException:
        for folder in missing:
            with contextlib.suppress(OSError):
                folder.rmdir()
        raise


def check_place(path: Path) -> None:
    """Find out that nothing can be put at a path before the work is done whose result it would hold.

    Folders above it that are missing will be made. The nearest that is there gets a file without a name for a moment:
    permission bits say little to the superuser, and nothing of file systems that cannot be written.

    Raises:
        InputError: it cannot.
    """
    with system_errors(path):
        folder = next(above for above in Path(os.path.realpath(path)).parents if above.exists())
        if not folder.is_dir():
            raise InputError(f"{path}: cannot be written ({folder} is a file)")
        tempfile.TemporaryFile(dir=folder).close()


def check_target(path: Path, suffix: str = "") -> None:
    """Find out that a file cannot be written before the work is done whose result it would hold.

    Args:
        path: the file.
        suffix: how its name must end, ``".html"`` for example; any name will do if empty.

    Raises:
        InputError: the target is a folder or a device, its name ends otherwise, or nothing can be put there.
    """
    with system_errors(path):  # a name too long for the system
        if path.is_dir():
            raise InputError(f"{path}: is a folder; name the file to write")
        if suffix and path.suffix != suffix:
            raise InputError(f"{path}: the file's name must end in {suffix}")
        if path.exists() and not path.is_file():
            raise InputError(f"{path}: is not a regular file; name another one to write")
    check_place(path)


def make_folder(path: Path) -> Path:
    """Create a folder and those above it, and find out whether it can be written.

    Raises:
        InputError: it cannot be created or written.
    """
    with system_errors(path, "made a folder"):
        path.mkdir(parents=True, exist_ok=True)
    check_place(path / "any")
    return path


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
