"""A trial's columns along what a cause leaves open, and its Gram matrices without that."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from discrepancy.least_squares.cell_grams import CellGrams
from discrepancy.least_squares.cells import Cells
from discrepancy.least_squares.opened import Opened
from estimator.arrays import Array


@dataclass(frozen=True, eq=False)
class Taken:
    """What lies along what causes leave open of a trial's columns, and is taken out of them.

    Attributes:
        cells: of the trial.
        each: unknowns, and how much of every column lies along them, shape (r, columns).
    """

    cells: Cells
    each: tuple[tuple[Opened, Array], ...]

    def of(self, span: slice, first: int = 0) -> Array:
        """Of some columns in the transform, of channels from one on, shape (n, C - first, k)."""
        parts = (one.basis.times(shares[:, span], first) for one, shares in self.each)
        return self.cells.spectrum(sum(parts, next(parts)))

    def products(self, rows: Array) -> Array:
        """Products with rows, shape (n, C, k) -> (columns, k)."""
        parts = (shares.T @ one.basis.products(rows) for one, shares in self.each)
        return sum(parts, next(parts))

    def grams(self, b: Array) -> Array:
        """The same over every cell with others in the transform, shape (n, C, k) -> (K, columns, k)."""
        return np.array([self.products(self.cells.only(cell, b)) for cell in range(len(self.cells.sizes))])


@dataclass(frozen=True, eq=False)
class Along:
    """All columns along what a cause leaves open in a trial: made once, for unknowns of whatever size.

    Attributes:
        opened: the unknowns, of any size.
        cells: of the trial.
        columns: all of them in the transform, of channels from one on, (n, C - first, columns), when asked for.
        edge: products of the unknowns' basis with them, shape (r, columns).
        by_own: the same of the trial's own unknowns over every cell, shape (K, columns, l).
    """

    opened: Opened
    cells: Cells
    columns: Callable[[int], Array]
    edge: Array
    by_own: Array

    @classmethod
    def of(cls, opened: Opened, cells: Cells, columns: Callable[[int], Array], by_own: Array) -> Along:
        """With the products found; the columns are without what the trial's own unknowns explain."""
        edge, first = np.zeros((0, by_own.shape[1])), opened.basis.first
        if len(opened.stretch):
            edge = opened.basis.products(cells.series(columns(first)), first)
        return cls(opened, cells, columns, edge, by_own)

    def of_size(self, size: float, grams: CellGrams) -> tuple[Opened, Array, CellGrams]:
        """The unknowns of a size, what lies along them (r, columns), and what becomes of the Gram matrices."""
        opened, cells = self.opened.of_size(size), self.cells
        if not len(self.edge):
            return opened, self.edge, grams
        shares = opened.shrink[:, None] * self.edge
        left = self.columns(self._first)
        left -= cells.spectrum(opened.basis.times(shares, self._first))  # in place: they are many
        left = left.reshape(-1, shares.shape[1])
        weights = opened.basis.weights @ shares
        # Elsewhere what is taken out is but the share of the trial's own unknowns, which are few.
        own = cells.spectrum(opened.basis.own)
        squares = cells.grams(own, own)

        def changed(cell: int, gram: Array) -> Array:
            if self._touched[cell]:
                here = left[self._numbers(cell)]
                return here.T @ here
            cross = self.by_own[cell] @ weights
            return gram - cross - cross.T + weights.T @ squares[cell] @ weights

        return opened, shares, grams.changed(changed)

    @cached_property
    def _touched(self) -> NDArray[np.bool_]:
        """Which cells have channels in which the unknowns themselves show, shape (K,)."""
        return np.isin(np.arange(len(self.cells.sizes)), self.cells.index[:, self.opened.basis.first :])

    @cached_property
    def _first(self) -> int:
        """First channel of all that are in such cells."""
        there = np.flatnonzero(self._touched[self.cells.index].any(axis=0))
        return int(there[0])

    def _numbers(self, cell: int) -> NDArray[np.intp]:
        """Which numbers of flattened rows of those channels are in a cell."""
        row, channel = np.divmod(self.cells.numbers(cell), self.cells.index.shape[1])
        return row * (self.cells.index.shape[1] - self._first) + channel - self._first
