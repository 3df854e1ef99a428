"""Files and folders that appear whole or not at all: written beside their place, then renamed into it."""

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
    """A name in a folder that nothing has and that tells whose it is; scraps of dead processes there are removed."""
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
    """A folder that lasts as long as the block, in ``where`` or in the system's folder for temporary files."""
    path = scratch_name(Path(tempfile.gettempdir()) if where is None else where)
    path.mkdir(mode=0o700)
    try:
        yield path
    finally:
        _remove(path)


def _remove(path: Path) -> None:
    shutil.rmtree(path, ignore_errors=True)  # neither files nor links
    with suppress(OSError):
        path.unlink()


def _is_alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except OSError as error:
        return error.errno != errno.ESRCH  # another user's
    return True


EVERY_S = 0.5


def end_with(parent: int) -> None:
    """End this process soon after its parent has ended, however that was killed."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(EVERY_S)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def ends_with_this() -> Mapping[str, Any]:
    """What makes the workers of ``joblib.Parallel`` end with this process."""
    return {"initializer": end_with, "initargs": (os.getpid(),)}


LIST, FORMAT = ".mocobot-files", "mocobot-files"
"""The list: {format, kind: of the result, files: {path in the folder: SHA-256}}."""


def list_written(folder: Path, kind: str) -> None:
    """Write the list of all that a new folder holds, whose result is of a kind such as ``diagnosis``."""
    files = {str(path.relative_to(folder)): _digest(path) for path in _entries(folder)}
    write_json(folder / LIST, {"format": FORMAT, "kind": kind, "files": files})


def add_written(path: Path) -> None:
    """Add a file that was written into a folder later to the folder's list, if there is one."""
    if values := _read(path.parent):
        values["files"][path.name] = _digest(path)
        write_json(path.parent / LIST, values)


def holds(kind: str) -> Callable[[Path], bool]:
    """What says whether a folder is a result of some kind, and raises an InputError if it holds anything else."""

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
    """Remove from a replaced folder what its list has, and move all else to the new one, under a free name."""
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
    """The path, or with ``.kept`` behind it where it is taken."""
    while os.path.lexists(path):
        path = path.with_name(f"{path.name}.kept")
    return path


def _entries(folder: Path) -> list[Path]:
    """Files, links and empty folders below a folder, but the list."""
    found = [path for path in folder.rglob("*") if path != folder / LIST]
    return sorted(p for p in found if p.is_symlink() or not p.is_dir() or not any(p.iterdir()))


def _is_written(path: Path, folder: Path, values: dict[str, Any]) -> bool:
    digest = values.get("files", {}).get(str(path.relative_to(folder)))
    return bool(digest) and digest == _digest(path)


def _digest(path: Path) -> str:
    """SHA-256 of a file; a word that is none for anything else."""
    with suppress(OSError):
        if not path.is_symlink():
            return "folder" if path.is_dir() else file_sha256(path)
    return ""


def _read(folder: Path) -> dict[str, Any]:
    """The list; empty if there is none that can be used."""
    with suppress(InputError):
        values = read_json(folder / LIST, "a list of what was written")
        if values.get("format") == FORMAT and isinstance(values.get("files"), dict):
            return values
    return {}


FULL = (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EIO)
"""What a disk says that takes no more."""
_State = tuple[int, int, int] | None
_checked: dict[Path, _State] = {}
"""What was at the place of a file when it was checked, before the work; None for nothing."""


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A temporary name beside ``path`` for a file that takes its place when the block ends without an error.

    Missing folders above it are made. A file that somebody else has put there since the place was checked
    (``check_target``) is kept, with ``.kept`` behind its name.

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
    """A temporary folder that takes the place of ``path`` when the block ends without an error.

    Missing folders above it are made. What cannot be written inside is told by its place in ``path``. The folder gets
    a list of what is in it, with the kind of result. What the list of a replaced folder has is removed; everything else
    is kept, and has ``.kept`` behind its name where the new folder has the same one.

    Raises:
        InputError: it cannot be created or put in place.
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
        except OSError as error:  # of libraries that write pictures
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
    """A block before which the missing folders above ``path`` are made, and taken away again if it fails."""
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

    Its name must end in ``suffix``, such as ``".html"``; any name will do if that is empty.

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
        real = Path(os.path.realpath(path))
        _checked[real] = _state(real)
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
    with system_errors(path, "read"):
        return {
            "name": path.name, "path": str(path), "bytes": path.stat().st_size, "sha256": file_sha256(path)
        }  # fmt: skip


def write_text(path: Path, text: str) -> None:
    """Write UTF-8 text; in a ``.txt`` file, which terminals show, control characters are escaped.

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
    """A block in which what the operating system refuses becomes one sentence: that ``path`` cannot be ``done``.

    Raises:
        InputError: it refuses something.
    """
    try:
        yield
    except OSError as error:
        raise InputError(f"{path}: cannot be {done} ({error.strerror or error})") from error


def write_archive(path: Path, facts: Any, arrays: Mapping[str, NDArray[Any]], *, compress: bool) -> None:
    """Write plain values and arrays to one NPZ file, without pickles: ``facts`` is the bytes of a JSON text.

    Raises:
        OSError: it cannot be written.
    """
    import numpy as np  # of no use to those who write texts only

    told = np.frombuffer(json.dumps(facts).encode(), dtype=np.uint8)
    with path.open("wb") as file:
        (np.savez_compressed if compress else np.savez)(file, allow_pickle=False, facts=told, **arrays)


def read_archive(path: Path, what: str) -> tuple[Any, dict[str, NDArray[Any]]]:
    """Read what ``write_archive`` wrote; messages call it ``what``.

    Raises:
        InputError: there is no such file, it is not whole, or unpacks to too much.
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
    except Exception as error:  # on damaged bytes numpy and zipfile raise many types
        raise InputError(f"{path}: not {what}, or damaged ({words(error)})") from error


def refuse_other_packing(archive: zipfile.ZipFile, where: str) -> None:
    """Refuse entries packed as numpy never does: Python unpacks these without a limit.

    Raises:
        InputError: there is one.
    """
    for entry in archive.infolist():
        if entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise InputError(f"{where}: entry {entry.filename!r:.60} is not packed as numpy does it")


def words(error: Exception) -> str:
    """What a library says of a damaged file, in one line."""
    return " ".join(str(error).split())[:120] or type(error).__name__
