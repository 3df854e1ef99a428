"""A trial's columns along what causes leave open, and its Gram matrices without that."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from discrepancy import rules
from discrepancy.least_squares.cell_grams import CellGrams
from discrepancy.least_squares.cells import Cells
from discrepancy.least_squares.columns import portions
from discrepancy.least_squares.opened import Opened, shares_of
from discrepancy.least_squares.span import Span
from estimator.arrays import Array


@dataclass(frozen=True, eq=False)
class Taken:
    """What lies along what causes leave open of a trial's columns, and is taken out of them.

    Attributes:
        cells: of the trial.
        each: unknowns, of one cause after the other.
        shares: how much of the last one's span is taken out of every column, shape (m, columns).
        kept: products of that span with every column, once asked for.
    """

    cells: Cells
    each: tuple[Opened, ...]
    shares: Array
    kept: list[Array] = field(default_factory=list, repr=False)

    @classmethod
    def nothing(cls, cells: Cells, own: int, columns: int) -> Taken:
        """Of a trial with so many unknowns of its own and columns."""
        none = np.zeros((own, columns))
        return cls(cells, (), none, [none])

    @property
    def is_nothing(self) -> bool:
        """Whether nothing is taken out."""
        return not any(len(one.stretch) for one in self.each)

    @property
    def span(self) -> Span:
        """Of all unknowns."""
        return self.each[-1].span

    def beside(self, columns: Callable[[int], Array]) -> Array:
        """Products of the span with every column, shape (m, columns).

        Args:
            columns: all of them in the transform, of channels from one on, when asked for; without what the trial's own
                unknowns explain, but with what is taken out for causes.
        """
        if not self.kept:
            self.kept.append(self.span.products(self.cells.series(columns(0))))
        return self.kept[0]

    def of(self, columns: slice) -> Array:
        """Of some columns in the transform, shape (n, C, k)."""
        return self.cells.spectrum(self.span.times(self.shares[:, columns]))

    def products(self, rows: Array) -> Array:
        """Products with rows, shape (n, C, k) -> (columns, k)."""
        return self.shares.T @ self.span.products(rows)

    def grams(self, b: Array) -> Array:
        """The same over every cell with others in the transform, shape (n, C, k) -> (K, columns, k)."""
        only = (self.cells.only(cell, b) for cell in range(len(self.cells.sizes)))
        products = [self.products(some) for some in portions(only, rules.TOLD_BYTES)]
        each = np.concatenate(products, axis=1).reshape(-1, len(self.cells.sizes), b.shape[2])
        return np.swapaxes(each, 0, 1)

    def replaced(self, start: int, stop: int, new: Array) -> tuple[Taken, Array]:
        """With others in place of some columns, and what is left of these.

        Args:
            start, stop: columns that go.
            new: without what the trial's own unknowns can explain, shape (n, C, k).
        """
        beside = self.span.products(new)
        shares = shares_of(self.each, beside)
        kept = [spliced(old, start, stop, beside) for old in self.kept]
        taken = Taken(self.cells, self.each, spliced(self.shares, start, stop, shares), kept)
        return taken, new - self.span.times(shares)


def spliced(old: Array, start: int, stop: int, new: Array) -> Array:
    """With others in place of some columns, those of the second axis."""
    return np.concatenate([old[:, :start], new, old[:, stop:]], axis=1)


@dataclass(frozen=True, eq=False)
class Along:
    """All columns along what one more cause leaves open in a trial: made once, for unknowns of whatever size.

    Attributes:
        taken: what is taken out for other causes already.
        opened: the unknowns, of any size.
        columns: all of them, as of ``Taken.beside``.
        beside: products of the unknowns' span with them, shape (m, columns).
        by_own: the same of the trial's own unknowns over every cell, shape (K, columns, l); of what is left of them.
    """

    taken: Taken
    opened: Opened
    columns: Callable[[int], Array]
    beside: Array
    by_own: Array

    @classmethod
    def of(cls, taken: Taken, opened: Opened, columns: Callable[[int], Array], by_own: Array) -> Along:
        """With the products found."""
        new, first = opened.columns, opened.columns.first
        late = np.zeros((new.width, by_own.shape[1]))
        if new.width:
            late = new.products(taken.cells.series(columns(first)), first)
        return cls(taken, opened, columns, np.concatenate([taken.beside(columns), late]), by_own)

    def of_size(self, size: float, grams: CellGrams) -> tuple[Opened, Taken, CellGrams, Array]:
        """The unknowns of a size, what is taken out with them, and what becomes of the Gram matrices and ``by_own``."""
        opened, cells, span = self.opened.of_size(size), self.taken.cells, self.opened.span
        change = opened.basis @ (opened.shrink[:, None] * self._edge)
        shares = self._before + change
        taken = Taken(cells, (*self.taken.each, opened), shares)
        if not len(opened.stretch):
            return opened, taken, grams, self.by_own
        left = self.columns(self._first)
        left -= cells.spectrum(span.times(shares, self._first))  # in place: they are many
        left = left.reshape(-1, shares.shape[1])
        # Elsewhere what is taken out is but the share of the trial's own unknowns, which are few.
        own, weights = cells.spectrum(span.own), change[span.dense]
        squares, flat_own, by_own = (
            cells.grams(own, own),
            own.reshape(cells.index.size, own.shape[2]),
            np.empty(self.by_own.shape),
        )

        def changed(cell: int, gram: Array) -> Array:
            if self._touched[cell]:
                here = left[self._numbers(cell)]
                by_own[cell] = here.T @ flat_own[cells.numbers(cell)]
                return here.T @ here
            by_own[cell] = self.by_own[cell] - weights.T @ squares[cell]
            cross = self.by_own[cell] @ weights
            return gram - cross - cross.T + weights.T @ squares[cell] @ weights

        return opened, taken, grams.changed(changed), by_own

    @cached_property
    def _before(self) -> Array:
        """What is taken out for others, as how much of the span's columns, shape (m, columns)."""
        none = np.zeros((self.opened.columns.width, self.beside.shape[1]))
        return np.concatenate([self.taken.shares, none])

    @cached_property
    def _edge(self) -> Array:
        """Products of the unknowns' basis with what others leave of the columns, shape (r, columns)."""
        return self.opened.basis.T @ self.beside - self.opened.inside @ self._before

    @cached_property
    def _touched(self) -> NDArray[np.bool_]:
        """Which cells have channels in which the unknowns themselves show, shape (K,)."""
        index = self.taken.cells.index[:, self.opened.span.first :]
        return np.isin(np.arange(len(self.taken.cells.sizes)), index)

    @cached_property
    def _first(self) -> int:
        """First channel of all that are in such cells."""
        there = np.flatnonzero(self._touched[self.taken.cells.index].any(axis=0))
        return int(there[0])

    def _numbers(self, cell: int) -> NDArray[np.intp]:
        """Which numbers of flattened rows of those channels are in a cell."""
        channels = self.taken.cells.index.shape[1]
        row, channel = np.divmod(self.taken.cells.numbers(cell), channels)
        return row * (channels - self._first) + channel - self._first
