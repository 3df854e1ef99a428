"""Cells: a residual's numbers by group of channels and by frequency; the noise of each cell has a power of its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct, idct

from discrepancy import rules
from discrepancy.least_squares.gram import flat_gram
from estimator.arrays import Array


@dataclass(frozen=True, eq=False)
class Cells:
    """How one trial's rows fall into cells, by the cosine transform of those that follow each other.

    That transform is orthonormal, so white rows stay white; what varies smoothly in time is in few of its numbers. A
    stationary process adds to the power of the noise, by frequency: it needs no more than one number per cell.

    Attributes:
        moving: number of leading rows that follow each other; the rest stand alone.
        index: cell of every number, shape (n, C).
        sizes: numbers in every cell, shape (K,).
    """

    moving: int
    index: NDArray[np.intp]
    sizes: NDArray[np.intp]

    @classmethod
    def of(
        cls, rows: int, channels: int, moving: int | None = None, groups: Sequence[int] | None = None
    ) -> Cells:
        """Cells of a trial: octaves of frequency, and rows that stand alone, of every group of channels.

        Args:
            rows, channels: n, C.
            moving: leading rows that follow each other; None for all.
            groups: group of every channel, from 0; None for one group.
        """
        moving = rows if moving is None else moving
        share = (np.arange(rows) + 0.5) / max(moving, 1)  # of the highest frequency
        band = np.clip(rules.CELL_BANDS - 1 + np.floor(np.log2(share)) + 1, 0, rules.CELL_BANDS - 1).astype(
            np.intp
        )
        band[moving:] = rules.CELL_BANDS
        group = np.zeros(channels, dtype=np.intp) if groups is None else np.asarray(groups, dtype=np.intp)
        index = band[:, None] + (rules.CELL_BANDS + 1) * group[None, :]
        count = (rules.CELL_BANDS + 1) * (int(group.max(initial=0)) + 1)
        return cls(moving, index, np.bincount(index.ravel(), minlength=count))

    def spectrum(self, x: Array) -> Array:
        """Rows in cosine transform, shape (n, C, ...) -> the same."""
        out = np.array(x, dtype=np.float64)
        if self.moving:
            matrix = cosine_matrix(self.moving)
            moving = out[: self.moving]
            out[: self.moving] = (
                np.asarray(dct(moving, axis=0, norm="ortho")) if matrix is None else _times(matrix, moving)
            )
        return out

    def series(self, x: Array) -> Array:
        """The rows of a cosine transform, shape (n, C, ...) -> the same."""
        out = np.array(x, dtype=np.float64)
        if self.moving:
            matrix = cosine_matrix(self.moving)
            moving = out[: self.moving]
            out[: self.moving] = (
                np.asarray(idct(moving, axis=0, norm="ortho")) if matrix is None else _times(matrix.T, moving)
            )
        return out

    def grams(self, a: Array, b: Array) -> Array:
        """a^T b over the numbers of every cell, shapes (n, C, k), (n, C, l) -> (K, k, l)."""
        same, count = a is b, self.index.size
        a = np.take(a.reshape(count, a.shape[2]), self._by_cell, axis=0)
        b = a if same else np.take(b.reshape(count, b.shape[2]), self._by_cell, axis=0)
        spans = [slice(*pair) for pair in pairwise([0, *np.cumsum(self.sizes)])]
        pairs = ((a[at], b[at]) for at in spans)
        return np.array([flat_gram(one, one if same else other) for one, other in pairs])

    def left_by(self, off: Array) -> Array:
        """Numbers in every cell but those that go into orthonormal columns (n, C, l) taken out of all, shape (K,).

        A projection off them has the trace n - l, of which each cell has the part that is its own.
        """
        taken = np.sum(self.spectrum(off) ** 2, axis=2)
        own = np.bincount(self.index.ravel(), taken.ravel(), minlength=len(self.sizes))
        return np.maximum(self.sizes - own, 0.0)  # of which rounding may leave less

    def only(self, cell: int, x: Array) -> Array:
        """Rows whose transform x, shape (n, C, k), is nought but in a cell."""
        there = self.index == cell
        at = np.flatnonzero(there.any(axis=0))
        out = np.zeros(x.shape)
        out[:, at] = self.series(np.where(there[:, at, None], x[:, at], 0.0))
        return out

    def numbers(self, cell: int) -> NDArray[np.intp]:
        """Which numbers of flattened rows (n C, ...) are in a cell."""
        stop = int(self.sizes[: cell + 1].sum())
        return self._by_cell[stop - int(self.sizes[cell]) : stop]

    @cached_property
    def _by_cell(self) -> NDArray[np.intp]:
        """The numbers in the order of their cells."""
        return np.argsort(self.index.ravel(), kind="stable")


@lru_cache(maxsize=8)
def cosine_matrix(rows: int) -> Array | None:
    """The orthonormal cosine transform of so many rows as a matrix, where that is faster; otherwise None.

    A fast transform is slow where the number of rows has a large prime factor: of 446 rows it takes 2.6 times as long
    as the product, of 448 half as long.
    """
    largest, rest, factor = 1, rows, 2
    while rest > 1:
        while rest % factor == 0:
            largest, rest = factor, rest // factor
        factor += 1
    if largest <= rules.TRANSFORM_PRIME or rows > rules.TRANSFORM_ROWS:
        return None
    return np.asarray(dct(np.eye(rows), axis=0, norm="ortho"), dtype=np.float64)


def _times(matrix: Array, x: Array) -> Array:
    """Along the first axis."""
    return (matrix @ x.reshape(len(x), -1)).reshape(x.shape)
