"""Stages of an experiment: many tasks each, in several processes, with progress; outcomes kept on disk as they end."""

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
"""In the folder of the results, until all is done."""
OUTCOMES = (Recording, TrialSummary, PayloadEstimate, Calibration)
WHAT = "an outcome of an interrupted run"


class Store:
    """A folder of outcomes, a file each, that appear whole or not at all.

    Plain values, arrays and the dataclasses of results: a run that goes on has the same bits as one that was never
    interrupted, and a file of somebody else's can do no more than be refused.
    """

    def __init__(self, out: Path, key: str, *, force: bool) -> None:
        """Open the store in a folder of results.

        The key is of everything that outcomes depend on; ``force`` drops what a run with another one left there.

        Raises:
            InputError: another run left something there, or it cannot be written.
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
        """Whether the outcome of a stage's task is there."""
        return self._file(stage, k).is_file()

    def get(self, stage: str, k: int) -> Any:
        """An outcome.

        Raises:
            InputError: it cannot be read.
        """
        path = self._file(stage, k)
        facts, arrays = read_archive(path, WHAT)
        try:
            return _value(facts, arrays)
        except (ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError) as error:
            raise InputError(f"{path}: not {WHAT} ({words(error)})") from error

    def put(self, stage: str, k: int, outcome: Any) -> None:
        """Keep an outcome.

        Raises:
            InputError: it cannot be written.
        """
        arrays: list[NDArray[Any]] = []
        facts = _plain(outcome, arrays)
        with whole_file(self._file(stage, k)) as temporary:
            write_archive(temporary, facts, {str(k): array for k, array in enumerate(arrays)}, compress=False)

    def drop(self) -> None:
        """Remove everything: the results are written."""
        shutil.rmtree(self._top, ignore_errors=True)

    def _file(self, stage: str, k: int) -> Path:
        return self.folder / f"{stage.replace(' ', '-')}-{k}.npz"


def _plain(value: Any, arrays: list[NDArray[Any]]) -> Any:
    """A value as JSON has it: lists, plain scalars, and pairs of a kind and what it holds; arrays by number."""
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
        return arrays[str(held)][()]  # a scalar as it was
    if kind == "tuple":
        return tuple(_value(each, arrays) for each in held)
    values = {key: _value(each, arrays) for key, each in held.items()}
    return values if kind == "dict" else _kinds()[kind](**values)


@cache
def _kinds() -> dict[str, type]:
    """Dataclasses that outcomes are made of, by name."""
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
"""Time between two looks at the shares."""


@contextmanager
def shares(tasks: int, told: Callable[[float], object]) -> Iterator[Array]:
    """Watch tasks while the block runs; yields the share of each that is done, which they write to in any process.

    ``told`` is called, from a thread of its own, with how much is done, in tasks; at first with 0.
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
    """Runs stage after stage.

    Attributes:
        steps: tasks of all stages.
        progress: called with what is done, ``steps``, and the name of the stage.
        store: where outcomes are kept; None to keep none.
        remote: whether the processes are on other machines: they cannot say how much of a task is done.
    """

    def __init__(
        self, pool: Parallel, steps: int, progress: Progress, store: Store | None, *, remote: bool
    ) -> None:
        """Run in an open pool, which returns outcomes as they come (``generator_unordered``)."""
        self.steps, self.progress, self.store, self.remote = steps, progress, store, remote
        self._pool, self._before = pool, 0

    def each(
        self, stage: str, function: Callable[..., Any], tasks: Sequence[tuple[Any, ...]]
    ) -> Iterator[Any]:
        """Outcomes of a function of a share to write to and a task, in the order of the tasks."""
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
    """One task, with its number: outcomes come as they are done."""
    return k, function(np.zeros(1) if share is None else share, *task)
