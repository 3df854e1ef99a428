"""Look at joint logs of a single robot as they come: inspect each, and diagnose what is ready."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from time import sleep
from typing import TYPE_CHECKING

from estimator.errors import InputError
from estimator.files import system_errors
from mocobot.api.diagnosis import Diagnosis, diagnose
from mocobot.api.inspection import inspect
from mocobot.api.joints import MAP, read_model
from mocobot.api.recordings import Say
from mocobot_logs.formats import FORMATS, log_kind

if TYPE_CHECKING:
    from mocobot.api.joints import GivenModel
    from mocobot.options import WatchOptions

POLL_S = 2.0
"""Time between two looks at the files [s]. Chosen: a log that does not change for so long is finished."""


def logs_in(paths: Iterable[Path], but: Iterable[Path] = (), *, waiting: bool = False) -> list[Path]:
    """List the logs among the paths and in the folders among them; a folder may itself be a log, such as a bag.

    Args:
        paths: files and folders.
        but: files to leave out of the folders, such as the reference.
        waiting: whether a folder may be empty.

    Raises:
        InputError: a folder cannot be read, or holds no log.
    """
    found, known = [], {path.resolve() for path in but}
    for path in paths:
        is_folder = path.is_dir() and not _is_log(path)
        with system_errors(path, "read"):
            inside = sorted(path.iterdir()) if is_folder else [path]
        if is_folder:
            inside = [each for each in inside if _is_log(each) and each.resolve() not in known]
        if not inside and not waiting:
            raise InputError(f"{path}: holds no log; a log is {FORMATS}")
        found += inside
    return found


def _is_log(path: Path) -> bool:
    with suppress(InputError):
        return path.name != MAP and bool(log_kind(path))
    return False


def look_at_joints(
    logs: Sequence[Path], model: GivenModel, reference: Sequence[Path], options: WatchOptions, say: Say
) -> tuple[list[str], Diagnosis | None]:
    """Inspect logs of a robot, and diagnose those that are ready, all together.

    Returns:
        One line per log and one on the verdict, and the diagnosis, if there is one.

    Raises:
        InputError: the model, a log or its map cannot be read.
    """
    lines, ready = [], []
    robot = read_model(model, lock=options.lock, base=options.base)
    for path in logs:
        say(f"inspecting {path.name}")
        found = inspect(path, robot, map=options.map, episode=options.episode)
        why = "; ".join(finding.sentence for finding in found.findings)
        lines.append(f"{path}: {found.ready_for}{f': {why}' if why else ''}.")
        ready += [path] if found.is_ready else []
    if not ready:
        return [*lines, "Nothing can be diagnosed: no log is ready."], None
    try:
        diagnosis = diagnose(ready, robot, reference, map=options.map, episode=options.episode, say=say)
    except InputError as error:
        return [*lines, f"No diagnosis: {error}."], None
    return [*lines, verdict_line(diagnosis, "the reference" if reference else "the model")], diagnosis


def verdict_line(diagnosis: Diagnosis, against: str) -> str:
    """State the verdict, its causes and what remains; ``against`` is what the logs were held against."""
    verdict, named = diagnosis.verdict.replace("_", " ").upper(), [c.sentence for c in diagnosis.causes]
    return " ".join([f"Against {against}: {verdict}.", *named, *diagnosis.to_dict()["remains"]])


def new_logs(paths: Sequence[Path], but: Sequence[Path] = ()) -> Iterator[Path]:
    """Yield every log among the paths and in their folders once it stops growing, and again if it has grown; no end."""
    before: dict[Path, tuple[int, int]] = {}
    done: dict[Path, tuple[int, int]] = {}
    while True:
        now = {path: _size(path) for path in logs_in(paths, but, waiting=True)}
        for path, size in now.items():
            if before.get(path) == size and done.get(path) != size:
                done[path] = size
                yield path
        before = now
        sleep(POLL_S)


def _size(path: Path) -> tuple[int, int]:
    """Return the bytes and the time of the last change of a file, or of all files in a folder [ns]."""
    files = [path, *path.rglob("*")] if path.is_dir() else [path]
    each = []
    for file in files:
        with suppress(FileNotFoundError):  # the writer renamed it
            each.append(file.stat())
    return sum(stat.st_size for stat in each), max((stat.st_mtime_ns for stat in each), default=0)
