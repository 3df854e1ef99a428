"""What a user names to be read and written, checked before any work is done."""

import os
from collections.abc import Callable, Sequence
from pathlib import Path

from estimator.errors import InputError
from estimator.files import check_target, system_errors


def check_recordings(recordings: Sequence[Path], out: Path | None = None) -> None:
    """Each recording once, and an output that overwrites none of them.

    Raises:
        InputError: one is given twice, or the output is one of them or cannot be written.
    """
    seen: set[str] = set()
    for path in recordings:
        real = os.path.realpath(path)
        if real in seen:
            raise InputError(f"{path} is given twice, and would count twice")
        seen.add(real)
    if out is not None:
        if os.path.realpath(out) in seen:
            raise InputError(f"{out}: is one of the recordings; write the estimate to another file")
        check_target(out)


def map_file(name: str | None) -> list[Path]:
    """The file that a map is read from, none for a built-in one."""
    from mocobot_logs.map.files import MAPS

    return [] if name is None or name in MAPS else [Path(name)]


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
    with system_errors(path):
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


def make_folder(path: Path) -> Path:
    """Create a folder and its parents.

    Raises:
        InputError: it cannot be created.
    """
    with system_errors(path, "created"):
        path.mkdir(parents=True, exist_ok=True)
    return path
