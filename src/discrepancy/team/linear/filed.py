"""Linear trials of long recordings in files, and what is made of them one by one, when it is asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import overload

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from discrepancy.team.linear.reduction import Reduction
from discrepancy.team.linear.stored import given_back, is_stored, stored
from discrepancy.team.linear.trial_linear import TrialLinear
from estimator.arrays import Array

LINEAR_BYTES = 1.5e8
"""Of all linear trials, from which they are kept in files. Chosen: memory; those of seven minutes of three robots."""


def held(trials: Iterable[TrialLinear]) -> tuple[TrialLinear, ...]:
    """Trials one after the other, in files if together they take more memory than they should."""
    out: list[TrialLinear] = []
    total = 0
    for trial in trials:
        out.append(trial)
        total += sum(x.nbytes for x in _arrays(trial))
        if total > LINEAR_BYTES:
            out = [filed(each) for each in out]
    return tuple(out)


def filed(trial: TrialLinear) -> TrialLinear:
    """The same trial with its arrays in files."""
    data, J = trial.data, trial.J
    names = ("R_bi", "p_bi", "twist", "twist_dot", "wrench")
    return replace(
        trial, s=stored(trial.s), by_shared=stored(trial.by_shared), by_bases=stored(trial.by_bases),
        data=replace(data, **{name: stored(getattr(data, name)) for name in names}),
        J=replace(J, knots=tuple(map(stored, J.knots))),
        reduction=_reduction(trial.reduction),
    )  # fmt: skip


def is_filed(trial: TrialLinear) -> bool:
    """Whether a trial is in files."""
    return is_stored(trial.s)


def rested(trial: TrialLinear) -> None:
    """Let the system take what a trial takes until it is asked for again."""
    if is_filed(trial):
        given_back(*_arrays(trial), *(x for x in (trial.__dict__.get("by_wrist"),) if x is not None))


class OneByOne(Sequence[Array]):
    """So many arrays, each made by its number whenever it is asked for."""

    def __init__(self, of: Callable[[int], Array], count: int) -> None:
        self._of, self._count = of, count

    def __len__(self) -> int:
        return self._count

    @overload
    def __getitem__(self, at: int) -> Array: ...
    @overload
    def __getitem__(self, at: slice) -> list[Array]: ...
    def __getitem__(self, at: int | slice) -> Array | list[Array]:
        where = range(self._count)[at]
        return self._of(where) if isinstance(where, int) else [self._of(k) for k in where]


def _reduction(reduction: Reduction) -> Reduction:
    of = reduction.operator
    if is_stored(of.data):
        return reduction
    operator = csr_array((stored(of.data), stored(of.indices), of.indptr), shape=of.shape)
    return replace(reduction, operator=operator)


def _arrays(trial: TrialLinear) -> Iterator[NDArray[np.generic]]:
    """What is large of a trial."""
    data, of = trial.data, trial.reduction.operator
    yield from (trial.s, trial.by_shared, trial.by_bases, *trial.J.knots, of.data, of.indices)
    yield from (data.R_bi, data.p_bi, data.twist, data.twist_dot, data.wrench)
