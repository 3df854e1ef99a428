"""Gram matrices over every cell of one trial's rows; with other columns they share what stays."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from discrepancy.least_squares.cells import Cells
from discrepancy.least_squares.columns import Columns
from discrepancy.least_squares.stored import given_back, is_stored, stored
from estimator.arrays import Array

Indices = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class CellGrams:
    """Symmetric matrices (W, W) of K cells, as some of which all is known and edges of columns that came later.

    Ten robots have some hundred cells of 700 columns, of which one that is tried changes one to ten.

    Attributes:
        first: Gram matrices of what was there at first, shape (K, B, B).
        edge: products of all columns with those that came later, shape (K, W, E).
        old: which of the first each column is, or -1, shape (W,).
        new: which of the edge's each column is, or -1, shape (W,).
    """

    first: Array
    edge: Array
    old: Indices
    new: Indices

    @classmethod
    def of(cls, grams: Array) -> CellGrams:
        """From whole matrices, shape (K, W, W)."""
        cells, width, _ = grams.shape
        return cls(grams, np.zeros((cells, width, 0)), np.arange(width), np.full(width, -1, dtype=np.intp))

    @classmethod
    def of_columns(cls, columns: Columns, cells: Cells) -> CellGrams:
        """Of a trial's columns, and where these are: in memory, or in a file."""
        grams = cls.of(columns.own_grams(cells))
        return grams.stored() if columns.is_single else grams

    @property
    def cells(self) -> int:
        """How many there are, K."""
        return len(self.first)

    @property
    def width(self) -> int:
        """How many columns there are, W."""
        return len(self.old)

    def stored(self) -> CellGrams:
        """The same with the first matrices in a file."""
        return CellGrams(stored(self.first), self.edge, self.old, self.new)

    def whole(self, cell: int) -> Array:
        """One cell's matrix, shape (W, W)."""
        return self._joined(self.first[cell], self.edge[cell])

    def each(self, cells: Iterable[int]) -> Iterator[Array]:
        """Some cells' matrices one after the other; what is in a file is given back meanwhile."""
        for cell in cells:
            yield self.whole(cell)
            given_back(self.first)

    def weighted(self, weights: Array) -> Array:
        """All cells' matrices added up, each times its weight (K,), shape (W, W)."""
        first = np.tensordot(weights, self.first, 1)
        given_back(self.first)
        return self._joined(first, np.tensordot(weights, self.edge, 1))

    def squares(self, x: Array, start: int = 0) -> Array:
        """x^T G x of every cell, for the columns from ``start`` on that x has, shape (w,) -> (K,)."""
        values = np.zeros(self.width)
        values[start : start + len(x)] = x
        old, late = self.old >= 0, self.new >= 0
        there = np.zeros(self.first.shape[1])
        there[self.old[old]] = values[old]
        at = np.flatnonzero(there)
        if not len(at):
            first = np.zeros(self.cells)
        elif len(at) < 0.5 * len(there):
            first = np.einsum(
                "i,kij,j->k", there[at], self.first[:, at[:, None], at], there[at], optimize=True
            )
        else:
            first = np.einsum("i,kij,j->k", there, self.first, there, optimize=True)
        given_back(self.first)
        late_values = np.zeros(self.edge.shape[2])
        late_values[self.new[late]] = values[late]
        return first + (self.edge @ late_values) @ (np.where(late, 1.0, 2.0) * values)

    def summed(self, rows: Indices, columns: Indices) -> Array:
        """Elements of all cells together, at indices that broadcast."""
        rows, columns = np.broadcast_arrays(rows, columns)
        late = self.new[columns] >= 0
        # What came later is beside all columns; of two old ones the first matrices tell.
        i, j = np.where(late, rows, columns), np.where(late, columns, rows)
        edged = self.new[j] >= 0
        out = self.first[:, np.where(edged, 0, self.old[i]), np.where(edged, 0, self.old[j])].sum(axis=0)
        given_back(self.first)
        if edged.any():
            out = np.where(edged, self.edge[:, i, np.where(edged, self.new[j], 0)].sum(axis=0), out)
        return np.asarray(out, dtype=np.float64)

    def replaced(self, start: int, stop: int, edge: Array) -> CellGrams:
        """With others in place of the columns from ``start`` to ``stop``, which may be none.

        Args:
            start, stop: columns that go.
            edge: products of the new ones with all columns as they are then, themselves among them, (K, W', k).
        """
        count = edge.shape[2]
        none = np.full(count, -1, dtype=np.intp)
        old = np.concatenate([self.old[:start], none, self.old[stop:]])
        new = np.concatenate([self.new[:start], none, self.new[stop:]])
        kept = np.sort(np.concatenate([self.new[:start], self.new[stop:]]))
        kept = kept[kept >= 0]
        before = self.edge[..., kept]
        new[new >= 0] = np.searchsorted(kept, new[new >= 0])
        own = np.flatnonzero(new >= 0)
        # Between what came later and what comes now, the new edge tells.
        between = np.zeros((self.cells, count, len(kept)))
        between[..., new[own]] = np.swapaxes(edge[:, own], 1, 2)
        beside = np.concatenate([before[:, :start], between, before[:, stop:]], axis=1)
        new[start : start + count] = len(kept) + np.arange(count)
        return CellGrams(self.first, np.concatenate([beside, edge], axis=2), old, new)

    def changed(self, of: Callable[[int, Array], Array]) -> CellGrams:
        """With every cell's matrix (W, W) changed, by the number of the cell."""
        first = np.empty((self.cells, self.width, self.width))
        for cell, gram in enumerate(self.each(range(self.cells))):
            first[cell] = of(cell, gram)
        out = CellGrams.of(first)
        return out.stored() if is_stored(self.first) else out

    def _joined(self, first: Array, edge: Array) -> Array:
        """The matrix of all columns from one of the first and one of the later, (B, B) and (W, E) -> (W, W)."""
        if not edge.shape[1]:
            return first
        late, out = np.flatnonzero(self.new >= 0), np.empty((self.width, self.width))
        for rows, old_rows in self._runs:
            for columns, old_columns in self._runs:
                out[rows, columns] = first[old_rows, old_columns]
        out[:, late] = edge[:, self.new[late]]
        out[late] = out[:, late].T
        return out

    @cached_property
    def _runs(self) -> list[tuple[slice, slice]]:
        """Successive columns that were successive at first, too: where they are now, and where they were."""
        at = np.flatnonzero(self.old >= 0)
        breaks = np.flatnonzero((np.diff(at) != 1) | (np.diff(self.old[at]) != 1)) + 1
        runs = [run for run in np.split(at, breaks) if len(run)]
        return [(slice(run[0], run[-1] + 1), slice(self.old[run[0]], self.old[run[-1]] + 1)) for run in runs]
