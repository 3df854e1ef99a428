"""Columns that are each there for a while only, such as torques of friction at single rests: patch by patch.

A trial has hundreds of them, each in some rows and some channels: dense, they would be a diagnosis' largest arrays.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from discrepancy import rules
from estimator.arrays import Array


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

    def within(self, x: Array, first: int = 0) -> Array:
        """The same numbers of others, of channels from one on, shape (n, C - first, l) -> (rows (C - first), l)."""
        part = x[self.where, self.first - first :]
        return part.reshape(part.shape[0] * part.shape[1], x.shape[2])

    def cross(self, other: Patch) -> Array:
        """Products with the columns of another, shape (k, l)."""
        if self.rows[0] > other.rows[-1] or other.rows[0] > self.rows[-1]:
            return np.zeros((self.values.shape[2], other.values.shape[2]))
        first = max(self.first, other.first)
        here, there = self._shared(other)
        a, b = self.values[here, first - self.first :], other.values[there, first - other.first :]
        return a.reshape(-1, a.shape[2]).T @ b.reshape(-1, b.shape[2])

    def _shared(self, other: Patch) -> tuple[Any, Any]:
        """Which of its own rows are those of another, and which of the other's."""
        a, b = self.where, other.where
        if isinstance(a, slice) and isinstance(b, slice):
            start, stop = max(a.start, b.start), min(a.stop, b.stop)
            return slice(start - a.start, stop - a.start), slice(start - b.start, stop - b.start)
        _, here, there = np.intersect1d(self.rows, other.rows, assume_unique=True, return_indices=True)
        return here, there


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

    @property
    def first(self) -> int:
        """Channel from which on any is not nought."""
        return min((patch.first for patch in self.each), default=self.shape[1])

    @cached_property
    def spans(self) -> list[slice]:
        """Which columns are in each patch."""
        return [slice(*pair) for pair in pairwise(np.cumsum([0, *(p.values.shape[2] for p in self.each)]))]

    def beside(self, others: Iterable[Patches]) -> Patches:
        """These columns, and then others of the same trial."""
        return Patches(self.shape, (*self.each, *(patch for other in others for patch in other.each)))

    def dense(self) -> Array:
        """All of them, shape (n, C, k)."""
        return self.times(np.eye(self.width))

    def times(self, z: Array, first: int = 0) -> Array:
        """The columns, each times its numbers in z, of channels from one on, shape (k, l) -> (n, C - first, l)."""
        out = np.zeros((self.shape[0], self.shape[1] - first, z.shape[1]))
        self.add_times(z, out, first)
        return out

    def add_times(self, z: Array, out: Array, first: int = 0) -> None:
        """Add the same to rows, shape (n, C - first, l), in place."""
        for patch, span in zip(self.each, self.spans, strict=True):
            sums = (patch.flat @ z[span]).reshape(*patch.values.shape[:2], -1)
            out[patch.where, max(patch.first - first, 0) :] += sums[:, max(first - patch.first, 0) :]

    def products(self, x: Array, first: int = 0) -> Array:
        """Products with other columns over rows and channels from one on, shape (n, C - first, l) -> (k, l)."""
        parts = (patch.flat.T @ patch.within(x, first) for patch in self.each)
        return np.concatenate([np.zeros((0, x.shape[2])), *parts])

    def cross(self, other: Patches) -> Array:
        """The same with columns that are patches, too, shape (k, l)."""
        out = np.zeros((self.width, other.width))
        for k, (patch, at) in enumerate(zip(self.each, self.spans, strict=True)):
            for n, (of, there) in enumerate(zip(other.each, other.spans, strict=True)):
                if self is other and n < k:
                    out[at, there] = out[there, at].T
                else:
                    out[at, there] = patch.cross(of)
        return out

    def together(self, least: int = rules.PATCH_COLUMNS) -> Patches:
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
        kept = ((patch, V[:, squares > rules.PATCH_SHOWS**2 * most]) for patch, (squares, V) in pairs)
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
