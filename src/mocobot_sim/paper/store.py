"""Run the stages of an experiment in parallel processes, with progress, and store the outcome of each task on disk."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from functools import cache
from pathlib import Path
from threading import Event, Thread
from typing import Any, get_args, get_type_hints

import numpy as np
from joblib import Parallel, delayed
from numpy.typing import NDArray

from estimator.arrays import Array
from estimator.calibrate.calibration import Calibration
from estimator.errors import InputError
from estimator.estimate.result import PayloadEstimate
from estimator.files import make_folder, read_archive, scratch_folder, whole_file, words, write_archive
from estimator.recording.model import Recording
from mocobot_sim.paper.scoring import TrialSummary

FOLDER = "partial"
"""Subfolder of the results folder that holds the outcomes until the run is complete."""
OUTCOMES = (Recording, TrialSummary, PayloadEstimate, Calibration)
WHAT = "an outcome of an interrupted run"


class Store:
    """A folder with one file per outcome; files appear complete or not at all.

    Outcomes consist of plain values, arrays and the dataclasses of results. A resumed run gives results identical to an
    uninterrupted one. Reading a file never executes code, so a foreign file can only be refused.
    """

    def __init__(self, out: Path, key: str, *, force: bool) -> None:
        """Open the store in a results folder.

        Args:
            out: results folder.
            key: hash of everything that the outcomes depend on.
            force: whether to delete outcomes of runs with other keys.

        Raises:
            InputError: there are outcomes of a run with another key, or the folder cannot be written.
        """
        self._top = out / FOLDER
        self.folder = self._top / key
        others = [path for path in self._top.glob("*") if path.name != key] if self._top.is_dir() else []
        if others and not force:
            raise InputError(
                f"{out}: holds parts of an interrupted run with other options, inputs or versions; give --force to "
                "drop them, or name a new folder"
            )
        for path in others:
            shutil.rmtree(path, ignore_errors=True)
        make_folder(self.folder)

    def has(self, stage: str, k: int) -> bool:
        """Whether the outcome of task ``k`` of a stage is stored."""
        return self._file(stage, k).is_file()

    def get(self, stage: str, k: int) -> Any:
        """Read the outcome of task ``k`` of a stage.

        Raises:
            InputError: the file cannot be read or is not an outcome.
        """
        path = self._file(stage, k)
        facts, arrays = read_archive(path, WHAT)
        try:
            return _value(facts, arrays)
        except (ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError) as error:
            raise InputError(f"{path}: not {WHAT} ({words(error)})") from error

    def put(self, stage: str, k: int, outcome: Any) -> None:
        """Store the outcome of task ``k`` of a stage.

        Raises:
            InputError: the file cannot be written.
        """
        arrays: list[NDArray[Any]] = []
        facts = _plain(outcome, arrays)
        with whole_file(self._file(stage, k)) as temporary:
            write_archive(temporary, facts, {str(k): array for k, array in enumerate(arrays)}, compress=False)

    def drop(self) -> None:
        """Delete all stored outcomes; call it after the results are written."""
        shutil.rmtree(self._top, ignore_errors=True)

    def _file(self, stage: str, k: int) -> Path:
        return self.folder / f"{stage.replace(' ', '-')}-{k}.npz"


def _plain(value: Any, arrays: list[NDArray[Any]]) -> Any:
    """Encode a value for JSON: lists, scalars, and objects {kind: content}; arrays are collected and referenced."""
    if isinstance(value, np.ndarray | np.generic):
        arrays.append(np.asarray(value))
        return {"array": len(arrays) - 1}
    if is_dataclass(value):
        return {type(value).__name__: {f.name: _plain(getattr(value, f.name), arrays) for f in fields(value)}}
    if isinstance(value, dict):
        return {"dict": {key: _plain(each, arrays) for key, each in value.items()}}
    if isinstance(value, tuple | list):
        listed = [_plain(each, arrays) for each in value]
        return {"tuple": listed} if isinstance(value, tuple) else listed
    return value


def _value(told: Any, arrays: dict[str, NDArray[Any]]) -> Any:
    """Inverse of ``_plain``."""
    if isinstance(told, list):
        return [_value(each, arrays) for each in told]
    if not isinstance(told, dict):
        return told
    ((kind, held),) = told.items()
    if kind == "array":
        return arrays[str(held)][()]  # turns a 0-d array back into a scalar
    if kind == "tuple":
        return tuple(_value(each, arrays) for each in held)
    values = {key: _value(each, arrays) for key, each in held.items()}
    return values if kind == "dict" else _kinds()[kind](**values)


@cache
def _kinds() -> dict[str, type]:
    """Dataclasses that can occur in outcomes, by name."""
    return {kind.__name__: kind for root in OUTCOMES for kind in _within(root)}


def _within(kind: Any) -> Iterator[type]:
    inner = get_args(kind)
    if is_dataclass(kind):
        assert isinstance(kind, type)
        yield kind
        inner = get_type_hints(kind).values()
    for each in inner:
        yield from _within(each)


EVERY_S = 0.2
"""Interval between two reports of progress [s]. Chosen."""


@contextmanager
def shares(tasks: int, told: Callable[[float], object]) -> Iterator[Array]:
    """Context manager that reports the progress of tasks in any process.

    It yields a shared array with one entry per task, to which a task writes the fraction that is done. ``told`` is
    called with the sum of the entries: first with 0, then regularly from a separate thread.
    """
    with scratch_folder() as folder:
        done = np.memmap(folder / "shares", dtype=float, mode="w+", shape=(tasks,))
        over = Event()

        def tell() -> None:
            ends = False
            while not ends:
                ends = over.wait(EVERY_S)
                told(float(done.sum()))

        told(0.0)
        thread = Thread(target=tell, daemon=True)
        thread.start()
        try:
            yield done
        finally:
            over.set()
            thread.join()


Progress = Callable[[float, float, str], object]


class Work:
    """Runs the stages of an experiment one after the other.

    Attributes:
        steps: number of tasks of all stages.
        progress: called with the number of tasks done, ``steps``, and the name of the stage.
        store: store for outcomes; None to store none.
        remote: whether the processes run on other machines, where they cannot report fractions of a task.
    """

    def __init__(
        self, pool: Parallel, steps: int, progress: Progress, store: Store | None, *, remote: bool
    ) -> None:
        """Use an open joblib pool that returns outcomes in order of completion (``generator_unordered``)."""
        self.steps, self.progress, self.store, self.remote = steps, progress, store, remote
        self._pool, self._before = pool, 0

    def each(
        self, stage: str, function: Callable[..., Any], tasks: Sequence[tuple[Any, ...]]
    ) -> Iterator[Any]:
        """Run all tasks of a stage and yield their outcomes in the order of the tasks.

        ``function`` is called with an array of one entry for its progress, followed by the items of the task.
        """
        start, self._before = self._before, self._before + len(tasks)
        kept = {k for k in range(len(tasks)) if self.store is not None and self.store.has(stage, k)}
        with shares(len(tasks), lambda now: self.progress(start + now, self.steps, stage)) as done:
            done[list(kept)] = 1.0
            calls = (
                delayed(_run)(None if self.remote else done[k : k + 1], k, function, task)
                for k, task in enumerate(tasks)
                if k not in kept
            )
            ended, following = {}, 0
            outcomes: Any = self._pool(calls)
            for k, outcome in outcomes:
                done[k] = 1.0
                if self.store is not None:
                    self.store.put(stage, k, outcome)
                ended[k] = outcome
                while following in ended or following in kept:
                    yield self._take(stage, following, ended)
                    following += 1
            while following < len(tasks):
                yield self._take(stage, following, ended)
                following += 1

    def _take(self, stage: str, k: int, ended: dict[int, Any]) -> Any:
        if k in ended:
            return ended.pop(k)
        assert self.store is not None
        return self.store.get(stage, k)


def _run(share: Array | None, k: int, function: Callable[..., Any], task: tuple[Any, ...]) -> tuple[int, Any]:
    """Run one task; return its number with the outcome, because outcomes arrive in any order."""
    return k, function(np.zeros(1) if share is None else share, *task)
