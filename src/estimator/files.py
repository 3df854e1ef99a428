"""Write files and folders atomically: write next to the target, then rename."""

from __future__ import annotations

import errno
import json
import os
import re
import shutil
import socket
import tempfile
import threading
import time
import uuid
import zipfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from estimator.errors import InputError
from estimator.inputs import Unpacked, file_sha256, open_input, plain, printable
from estimator.strict import read_json

if TYPE_CHECKING:
    from numpy.typing import NDArray

_HOST = re.sub(r"\W", "", socket.gethostname())[:40]
_NAME = re.compile(rf"\.mocobot-{_HOST}-(\d{{1,9}})-[0-9a-f]{{8}}\.tmp")
_swept: set[Path] = set()


def scratch_name(folder: Path) -> Path:
    """Return an unused name in a folder that identifies this process; remove leftovers of dead processes there."""
    if folder not in _swept:
        _swept.add(folder)
        with suppress(OSError):
            for path in folder.iterdir():
                found = _NAME.fullmatch(path.name)
                if found and not _is_alive(int(found[1])) and not path.with_suffix(".old").exists():
                    _remove(path)
    return folder / f".mocobot-{_HOST}-{os.getpid()}-{uuid.uuid4().hex[:8]}.tmp"


@contextmanager
def scratch_folder(where: Path | None = None) -> Iterator[Path]:
    """Make a folder for the duration of the block, in ``where`` or in the system's temporary folder."""
    path = scratch_name(Path(tempfile.gettempdir()) if where is None else where)
    path.mkdir(mode=0o700)
    try:
        yield path
    finally:
        _remove(path)


def _remove(path: Path) -> None:
    shutil.rmtree(path, ignore_errors=True)  # does not remove files or links
    with suppress(OSError):
        path.unlink()


def _is_alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except OSError as error:
        return error.errno != errno.ESRCH  # a process of another user is alive
    return True


EVERY_S = 0.5


def end_with(parent: int) -> None:
    """End this process soon after its parent has ended for any reason."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(EVERY_S)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def ends_with_this() -> Mapping[str, Any]:
    """Return options of ``joblib.Parallel`` that make its workers end with this process."""
    return {"initializer": end_with, "initargs": (os.getpid(),)}


LIST, FORMAT = ".mocobot-files", "mocobot-files"
"""File name and format of the list of a folder: {format, kind: of the result, files: {path in the folder: SHA-256}}.
"""


def list_written(folder: Path, kind: str) -> None:
    """Write the list of all files in a new folder, with the kind of its result, such as ``diagnosis``."""
    files = {str(path.relative_to(folder)): _digest(path) for path in _entries(folder)}
    write_json(folder / LIST, {"format": FORMAT, "kind": kind, "files": files})


def add_written(path: Path) -> None:
    """Add a file that was written later to the folder's list, if there is one."""
    if values := _read(path.parent):
        values["files"][path.name] = _digest(path)
        write_json(path.parent / LIST, values)


def holds(kind: str) -> Callable[[Path], bool]:
    """Return a function that tests whether a folder holds a result of some kind.

    The function raises an InputError if the folder holds such a result and also other or modified files.
    """

    def is_ours(folder: Path) -> bool:
        values = _read(folder)
        if values.get("kind") != kind:
            return False
        for path in _entries(folder):
            if not _is_written(path, folder, values):
                raise InputError(
                    f"{path}: was not written by mocobot, or changed since; move it elsewhere first"
                )
        return True

    return is_ours


def leave_others(folder: Path, new: Path) -> None:
    """Remove listed files from a replaced folder, and move all others to the new folder under a free name."""
    values = _read(folder)
    for path in _entries(folder):
        if _is_written(path, folder, values):
            path.rmdir() if path.is_dir() and not path.is_symlink() else path.unlink()
        else:
            target = new / path.relative_to(folder)
            target.parent.mkdir(parents=True, exist_ok=True)
            path.rename(free_name(target))
    if values:
        (folder / LIST).unlink()
    for path in sorted(folder.rglob("*"), reverse=True):
        with suppress(OSError):
            path.rmdir()
    folder.rmdir()


def free_name(path: Path) -> Path:
    """Return the path, or with ``.kept`` appended until it is free."""
    while os.path.lexists(path):
        path = path.with_name(f"{path.name}.kept")
    return path


def _entries(folder: Path) -> list[Path]:
    """Return files, links and empty folders below a folder, except the list."""
    found = [path for path in folder.rglob("*") if path != folder / LIST]
    return sorted(p for p in found if p.is_symlink() or not p.is_dir() or not any(p.iterdir()))


def _is_written(path: Path, folder: Path, values: dict[str, Any]) -> bool:
    digest = values.get("files", {}).get(str(path.relative_to(folder)))
    return bool(digest) and digest == _digest(path)


def _digest(path: Path) -> str:
    """Return the SHA-256 of a file, ``"folder"`` for a folder, or an empty text for anything else."""
    with suppress(OSError):
        if not path.is_symlink():
            return "folder" if path.is_dir() else file_sha256(path)
    return ""


def _read(folder: Path) -> dict[str, Any]:
    """Return the list; empty if there is no valid one."""
    with suppress(InputError):
        values = read_json(folder / LIST, "a list of what was written")
        if values.get("format") == FORMAT and isinstance(values.get("files"), dict):
            return values
    return {}


FULL = (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EIO)
"""Error numbers of a disk that cannot be written."""
_State = tuple[int, int, int] | None
_checked: dict[Path, _State] = {}
"""State of each target when it was checked, before the work; None for no file."""


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Yield a temporary name next to ``path`` for a file that replaces it when the block ends without an error.

    Missing parent folders are created. If another program has written the target since ``check_target``, that file is
    kept, with ``.kept`` appended to its name.

    Raises:
        InputError: the operating system refuses.
    """
    real = Path(os.path.realpath(path))
    with system_errors(path), _folders_above(path):
        temporary, before = scratch_name(real.parent), _checked.pop(real, _state(real))
        try:
            yield temporary
            if _state(real) not in (None, before):
                real.rename(free_name(real))
            temporary.replace(real)
        finally:
            with suppress(OSError):
                temporary.unlink(missing_ok=True)


def _state(path: Path) -> _State:
    try:
        found = path.lstat()
    except OSError:
        return None
    return found.st_ino, found.st_size, found.st_mtime_ns


@contextmanager
def whole_folder(path: Path, kind: str) -> Iterator[Path]:
    """Yield a temporary folder that replaces ``path`` when the block ends without an error.

    Missing parent folders are created. Messages about files inside refer to their place in ``path``. The folder gets a
    list of its files, with the kind of result. Files in the list of a replaced folder are removed. All others are
    kept, with ``.kept`` appended if the new folder has a file of the same name.

    Raises:
        InputError: the folder cannot be created or put in place.
    """
    real = Path(os.path.realpath(path))
    with _folders_above(path):
        temporary = scratch_name(real.parent)
        old = temporary.with_suffix(".old")
        try:
            with system_errors(path):
                temporary.mkdir()
            yield temporary
            with system_errors(path):
                list_written(temporary, kind)
                if real.exists():
                    real.rename(old)
                temporary.rename(real)
                if old.exists():
                    leave_others(old, real)
        except InputError as error:
            if str(temporary) not in str(error):
                raise
            raise InputError(str(error).replace(str(temporary), str(path))) from error
        except OSError as error:  # raised by libraries that write pictures
            if error.errno not in FULL:
                raise
            raise InputError(f"{path}: cannot be written ({error.strerror})") from error
        finally:
            if old.exists() and not real.exists():
                with suppress(OSError):
                    old.rename(real)
            shutil.rmtree(temporary, ignore_errors=True)


@contextmanager
def _folders_above(path: Path) -> Iterator[None]:
    """Create missing folders above ``path`` for the block, and remove them if it fails."""
    real = Path(os.path.realpath(path))
    missing = [folder for folder in real.parents if not folder.exists()]
    try:
        with system_errors(path):
            real.parent.mkdir(parents=True, exist_ok=True)
        yield
    except BaseException:
        for folder in missing:
            with suppress(OSError):
                folder.rmdir()
        raise


def check_place(path: Path) -> None:
    """Check that a path is writable before the work whose result it will hold.

    Missing parent folders are allowed. The nearest existing folder gets an unnamed temporary file. This also works for
    the superuser and for read-only file systems, unlike permission bits.

    Raises:
        InputError: it is not writable.
    """
    with system_errors(path):
        folder = next(above for above in Path(os.path.realpath(path)).parents if above.exists())
        if not folder.is_dir():
            raise InputError(f"{path}: cannot be written ({folder} is a file)")
        tempfile.TemporaryFile(dir=folder).close()


def check_target(path: Path, suffix: str = "") -> None:
    """Check that a file is writable before the work whose result it will hold.

    Its name must end in ``suffix``, such as ``".html"``; an empty suffix allows any name.

    Raises:
        InputError: the target is a folder or a device, its name has another suffix, or the place is not writable.
    """
    with system_errors(path):  # a name too long for the system
        if path.is_dir():
            raise InputError(f"{path}: is a folder; name the file to write")
        if suffix and path.suffix != suffix:
            raise InputError(f"{path}: the file's name must end in {suffix}")
        if path.exists() and not path.is_file():
            raise InputError(f"{path}: is not a regular file; name another one to write")
        real = Path(os.path.realpath(path))
        _checked[real] = _state(real)
    check_place(path)


def make_folder(path: Path) -> Path:
    """Create a folder and its parents, and check that it is writable.

    Raises:
        InputError: it cannot be created or written.
    """
    with system_errors(path, "made a folder"):
        path.mkdir(parents=True, exist_ok=True)
    check_place(path / "any")
    return path


def file_facts(path: Path) -> dict[str, Any]:
    """Return name, path as given, size and SHA-256 of a file, which is read in pieces.

    Raises:
        InputError: it cannot be read.
    """
    with system_errors(path, "read"):
        return {
            "name": path.name, "path": str(path), "bytes": path.stat().st_size, "sha256": file_sha256(path)
        }  # fmt: skip


def write_text(path: Path, text: str) -> None:
    """Write UTF-8 text; in a ``.txt`` file control characters are escaped, because terminals may show it.

    Raises:
        InputError: the target cannot be written.
    """
    with whole_file(path) as temporary:
        temporary.write_text(printable(text) if path.suffix == ".txt" else text, encoding="utf-8")


def write_json(path: Path, values: Mapping[str, Any]) -> None:
    """Write strict JSON (no NaN).

    Raises:
        InputError: the target cannot be written.
    """
    write_text(path, json.dumps(values, indent=1, allow_nan=False) + "\n")


@contextmanager
def system_errors(path: Path | str, done: str = "written") -> Iterator[None]:
    """Convert errors of the operating system inside the block to one sentence: ``path`` cannot be ``done``.

    Raises:
        InputError: the operating system refuses an operation.
    """
    try:
        yield
    except OSError as error:
        raise InputError(f"{path}: cannot be {done} ({error.strerror or error})") from error


def write_archive(path: Path, facts: Any, arrays: Mapping[str, NDArray[Any]], *, compress: bool) -> None:
    """Write plain values and arrays to one NPZ file without pickles; ``facts`` is stored as the bytes of a JSON text.

    Raises:
        OSError: it cannot be written.
    """
    import numpy as np  # not needed for writing text only

    told = np.frombuffer(json.dumps(facts).encode(), dtype=np.uint8)
    with path.open("wb") as file:
        (np.savez_compressed if compress else np.savez)(file, allow_pickle=False, facts=told, **arrays)


def read_archive(path: Path, what: str) -> tuple[Any, dict[str, NDArray[Any]]]:
    """Read a file of ``write_archive``; ``what`` is its description in messages.

    Raises:
        InputError: the file is missing or damaged, or unpacks to too much.
    """
    import numpy as np

    try:
        with open_input(path) as opened, zipfile.ZipFile(opened) as archive:
            refuse_other_packing(archive, str(path))
            Unpacked(str(path), path.stat().st_size).add(sum(entry.file_size for entry in archive.infolist()))
            arrays = {}
            for entry in archive.infolist():
                with archive.open(entry) as file:
                    name = entry.filename.removesuffix(".npy")
                    arrays[name] = np.lib.format.read_array(file, allow_pickle=False)
        if "facts" not in arrays:
            raise InputError(f"{path}: not {what}; 'facts' is missing")
        return plain(json.loads(arrays.pop("facts").tobytes())), arrays
    except InputError:
        raise
    except FileNotFoundError as error:
        raise InputError(f"{path}: there is no such file; it would be {what}") from error
    except Exception as error:  # numpy and zipfile raise many types for damaged bytes
        raise InputError(f"{path}: not {what}, or damaged ({words(error)})") from error


def refuse_other_packing(archive: zipfile.ZipFile, where: str) -> None:
    """Refuse compression methods that numpy does not use: Python unpacks them without a limit.

    Raises:
        InputError: an entry uses one.
    """
    for entry in archive.infolist():
        if entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise InputError(f"{where}: entry {entry.filename!r:.60} is not packed as numpy does it")


def words(error: Exception) -> str:
    """Return a library's error message about a damaged file in one line."""
    return " ".join(str(error).split())[:120] or type(error).__name__
