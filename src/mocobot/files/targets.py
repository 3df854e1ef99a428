"""What a user names to be read and written, checked before any work is done.

One rule for every command: nothing that exists is overwritten unasked. ``--force`` replaces a file, and a folder that
is an earlier result of the same command and nothing else; never an input.
"""

import os
from collections.abc import Callable, Sequence
from pathlib import Path

from estimator.errors import InputError
from estimator.files import check_place, check_target, system_errors
from mocobot_logs.formats import PARQUET as MAGIC
from mocobot_logs.formats import log_kind

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


CALIBRATION = "calibration.json"
"""The file in the folder of ``mocobot calibrate --out``."""


def check_recordings(recordings: Sequence[Path]) -> None:
    """At least one recording, each once.

    Raises:
        InputError: there is none, or one is given twice.
    """
    if not recordings:
        raise InputError("no recording given; name at least one file")
    seen: set[str] = set()
    for path in recordings:
        real = os.path.realpath(path)
        if real in seen:
            raise InputError(f"{path} is given twice, and would count twice")
        seen.add(real)


def check_there(paths: Sequence[Path]) -> None:
    """Find out that a file or folder to read is missing, or cut; what else may be wrong with it, reading tells.

    Raises:
        InputError: one is.
    """
    for path in paths:
        try:
            path.stat()
        except (FileNotFoundError, NotADirectoryError):
            raise InputError(f"{path}: there is no such file") from None
        except (OSError, ValueError):
            continue
        if path.is_file():
            check_parquet(path)


def check_formats(paths: Sequence[Path]) -> None:
    """Find out that a file is no log of any format that is read.

    Raises:
        InputError: one is not.
    """
    for path in paths:
        if path.is_file() and path.suffix.lower() not in (".json", ".parquet"):  # of those reading tells more
            log_kind(path)


def check_no_team(options: object, names: Sequence[str]) -> None:
    """Refuse options of a team's recordings where a model of one robot is given.

    Args:
        options: of the command.
        names: of those that must not be given.

    Raises:
        InputError: one is.
    """
    for name in names:
        if getattr(options, name):
            raise InputError(f"--{name} is of a team's robots; with --model there is none")


def map_file(name: str | None) -> list[Path]:
    """The file that a map is read from, none for a built-in one."""
    if name is None or not Path(name).is_file():
        return []
    from mocobot_logs.maps import MAPS  # takes time, and files are seldom named like built-in maps

    return [] if name in MAPS else [Path(name)]


def calibration_file(given: Path | None) -> list[Path]:
    """The file that a calibration is read from."""
    if given is None:
        return []
    return [given / CALIBRATION if given.is_dir() else given]


def check_output(path: Path, inputs: Sequence[Path] = (), *, force: bool, suffix: str = "") -> None:
    """Find out that a file may not be written, or cannot, before the work is done whose result it would hold.

    Args:
        path: the file.
        inputs: files and folders that must not be lost.
        force: whether an existing file may be replaced.
        suffix: how its name must end; any name will do if empty.

    Raises:
        InputError: it is an input or lies in one, it exists without ``force``, or see ``check_target``.
    """
    check_no_input(path, inputs)
    check_target(path, suffix)
    if path.exists() and not force:
        raise InputError(f"{path}: exists; give --force to replace it, or name another file")


def check_no_input(path: Path, inputs: Sequence[Path]) -> None:
    """Find out that an output is an input, or lies in one.

    Raises:
        InputError: it is, or does.
    """
    with system_errors(path):
        real = Path(os.path.realpath(path))
        for given in inputs:
            source = Path(os.path.realpath(given))
            if real == source or (source in real.parents and source.is_dir()):
                where = "is an input" if real == source else f"lies in the input {given}"
                raise InputError(f"{path}: {where}; write somewhere else")


def check_folder(
    path: Path, inputs: Sequence[Path], is_ours: Callable[[Path], bool], what: str, *, force: bool
) -> None:
    """Find out that a folder may not be written, or cannot, before the work is done whose result it would hold.

    Args:
        path: folder to be created or replaced.
        inputs: files that must not be lost.
        is_ours: whether an existing folder is an earlier result and nothing else.
        what: the kind of result, for messages.
        force: whether such a folder may be replaced; an empty one always may.

    Raises:
        InputError: it is a file, or holds an input or something that is no such result, or such a result without
            ``force``, or is the current folder, or nothing can be put there.
    """
    real = Path(os.path.realpath(path))
    with system_errors(path):
        if real.exists() and not real.is_dir():
            raise InputError(f"{path}: is a file; name a folder to write")
        if real in (here := Path.cwd(), *here.parents):
            raise InputError(f"{path}: is the current folder, or above it; name a folder of its own")
        for entry in inputs:
            if real in Path(os.path.realpath(entry)).parents:
                raise InputError(f"{path}: holds {entry}, which would be lost; name another folder")
        if real.exists() and any(real.iterdir()):
            if not is_ours(real):
                raise InputError(f"{path}: exists and is not {what}; name a new folder")
            if not force:
                raise InputError(f"{path}: is {what}; give --force to replace it, or name a new folder")
    check_place(path)
