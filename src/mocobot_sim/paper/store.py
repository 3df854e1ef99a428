"""Outcomes of an experiment's tasks on disk, so that an interrupted run goes on where it ended."""

import shutil
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from functools import cache
from pathlib import Path
from typing import Any, get_args, get_type_hints

import numpy as np
from numpy.typing import NDArray

from estimator.calibrate.calibration import Calibration
from estimator.errors import InputError
from estimator.estimate.result import PayloadEstimate
from estimator.files import make_folder, read_archive, whole_file, words, write_archive
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

        Args:
            out: that folder.
            key: of everything that outcomes depend on; a run with another one has nothing to do with this.
            force: drop what another run left there.

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
