"""Columns that are each there for a while only, such as torques of friction at single rests: patch by patch.

A trial has hundreds of them, each in some rows and some channels: dense, they would be a diagnosis' largest arrays.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from estimator.arrays import Array

PATCH_COLUMNS = 48
"""Of what a cause leaves open that are kept together. Chosen: a few seconds of friction at rest; of fewer, calls cost
more than numbers, of more, most numbers are nought."""

PATCH_SHOWS = 1e-6
"""Of what a cause leaves open, trace of one column over the largest from which it counts. Derived: the largest is some
hundred times the noise, so that one dropped is a ten-thousandth of it."""


@dataclass(frozen=True, eq=False)
class Patch:
    """Some columns where they are not nought.

    Attributes:
        rows: in which they are, increasing.
        first: channel from which on they are.
        values: shape (rows, C - first, k).
    """

    rows: NDArray[np.intp]
    first: int
    values: Array

    @cached_property
    def where(self) -> slice | NDArray[np.intp]:
        """The rows as an index: a slice, which copies nothing, where none is missing between the first and the last."""
        whole = len(self.rows) and self.rows[-1] - self.rows[0] + 1 == len(self.rows)
        return slice(int(self.rows[0]), int(self.rows[-1]) + 1) if whole else self.rows

    @property
    def flat(self) -> Array:
        """All their numbers, shape (rows (C - first), k)."""
        return self.values.reshape(-1, self.values.shape[2])


@dataclass(frozen=True, eq=False)
class Patches:
    """Columns of one trial, shape (n, C, k) if they were dense.

    Attributes:
        shape: n, C.
        each: successive columns.
    """

    shape: tuple[int, int]
    each: tuple[Patch, ...] = ()

    @classmethod
    def of(cls, x: Array) -> Patches:
        """From dense columns, shape (n, C, k)."""
        rows = np.flatnonzero(x.any(axis=(1, 2)))
        if not len(rows):
            return cls(x.shape[:2])
        first = int(np.argmax(x.any(axis=(0, 2))))
        return cls(x.shape[:2], (Patch(rows, first, np.ascontiguousarray(x[rows, first:])),))

    @property
    def width(self) -> int:
        """How many columns there are, k."""
        return sum(patch.values.shape[2] for patch in self.each)

    def beside(self, others: Iterable[Patches]) -> Patches:
        """These columns, and then others of the same trial."""
        return Patches(self.shape, (*self.each, *(patch for other in others for patch in other.each)))

    def together(self, least: int = PATCH_COLUMNS) -> Patches:
        """The same columns in patches of so many at least, of those that follow each other."""
        out: list[Patch] = []
        some: list[Patch] = []
        for patch in self.each:
            some.append(patch)
            if sum(p.values.shape[2] for p in some) >= least:
                out.append(_joined(some))
                some = []
        return Patches(self.shape, (*out, *([_joined(some)] if some else [])))

    def fewer(self) -> Patches:
        """As few columns as have the same products with their own transpose, but for what does not show.

        Normal unknowns of one size that are turned are such unknowns again; of knots closer than rows most show in
        nothing of their own.
        """
        turned = [np.linalg.eigh(patch.flat.T @ patch.flat) for patch in self.each]
        most = max((squares[-1] for squares, _ in turned), default=0.0)
        pairs = zip(self.each, turned, strict=True)
        kept = ((patch, V[:, squares > PATCH_SHOWS**2 * most]) for patch, (squares, V) in pairs)
        each = (Patch(patch.rows, patch.first, patch.values @ V) for patch, V in kept if V.shape[1])
        return Patches(self.shape, tuple(each))


def _joined(patches: Sequence[Patch]) -> Patch:
    """Several as one."""
    if len(patches) == 1:
        return patches[0]
    rows = np.unique(np.concatenate([patch.rows for patch in patches]))
    first, C = min(p.first for p in patches), patches[0].first + patches[0].values.shape[1]
    values = np.zeros((len(rows), C - first, sum(p.values.shape[2] for p in patches)))
    at = 0
    for patch in patches:
        stop = at + patch.values.shape[2]
        values[np.searchsorted(rows, patch.rows), patch.first - first :, at:stop] = patch.values
        at = stop
    return Patch(rows, first, values)
