"""What this program wrote into a result folder: a list of files and digests in it, so that nothing else is removed."""

import json
import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from estimator.errors import InputError
from estimator.inputs import file_sha256
from estimator.strict import read_json

LIST, FORMAT = ".mocobot-files", "mocobot-files"
"""The list: {format, kind: of the result, files: {path in the folder: SHA-256}}."""


def list_written(folder: Path, kind: str) -> None:
    """Write the list of all that a new folder holds.

    Args:
        folder: which nobody else has written into yet.
        kind: of the result, such as ``diagnosis``.
    """
    files = {str(path.relative_to(folder)): _digest(path) for path in _entries(folder)}
    _write(folder, {"format": FORMAT, "kind": kind, "files": files})


def add_written(path: Path) -> None:
    """Add a file that was written into a folder later to the folder's list, if there is one."""
    if values := _read(path.parent):
        values["files"][path.name] = _digest(path)
        _write(path.parent, values)


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


def _write(folder: Path, values: dict[str, Any]) -> None:
    (folder / LIST).write_text(json.dumps(values, indent=1) + "\n", encoding="utf-8")


def _read(folder: Path) -> dict[str, Any]:
    """The list; empty if there is none that can be used."""
    with suppress(InputError):
        values = read_json(folder / LIST, "a list of what was written")
        if values.get("format") == FORMAT and isinstance(values.get("files"), dict):
            return values
    return {}
