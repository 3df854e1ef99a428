"""Columns that are asked about again and again: what is needed of them over every cell is made once."""

from __future__ import annotations

import weakref
from collections.abc import Callable
from typing import Generic, TypeVar

import numpy as np

from discrepancy import rules
from discrepancy.least_squares.cells import Cells
from discrepancy.least_squares.columns import Columns
from discrepancy.least_squares.gram import gram_of
from estimator.arrays import Array

Kind = TypeVar("Kind")


class OfArrays(Generic[Kind]):
    """Something of every array, for as long as that is there."""

    def __init__(self) -> None:
        self._kept: dict[int, tuple[weakref.ref[Array], Kind]] = {}

    def __len__(self) -> int:
        return len(self._kept)

    def get(self, array: Array) -> Kind | None:
        """What is kept of an array; None if nothing is."""
        found = self._kept.get(id(array))
        return found[1] if found else None

    def keep(self, array: Array, value: Kind) -> Kind:
        """Keep something of an array, and give it back."""
        key = id(array)
        self._kept[key] = weakref.ref(array, lambda _: self._kept.pop(key, None)), value
        return value


class Asked:
    """Columns of one trial in the transform, without what its own unknowns can explain.

    Attributes:
        cells: of the trial.
        spectrum: the columns, shape (n, C, k).
        grams: their products with themselves over every cell, shape (K, k, k).
    """

    def __init__(self, cells: Cells, spectrum: Array) -> None:
        self.cells, self.spectrum, self.grams = cells, spectrum, cells.grams(spectrum, spectrum)
        self._beside = OfArrays[Array]()

    def own(self, weights: Array) -> Array:
        """Products with themselves, every cell times its weight (K,), shape (k, k)."""
        return np.tensordot(weights, self.grams, 1)

    def beside(self, columns: Columns, weights: Array) -> Array:
        """The same with all columns of the trial, shape (columns, k)."""
        weighted = self.spectrum * weights[self.cells.index][..., None]
        made: dict[int, Array] = {}
        for piece in columns.pieces:
            key = id(piece.whole)
            if key not in made:
                many = piece.whole.shape[2] >= rules.KEPT_COLUMNS
                made[key] = self._kept(piece.whole, weights) if many else gram_of(piece.whole, weighted)
        return np.concatenate([made[id(piece.whole)][piece.at] for piece in columns.pieces])

    def _kept(self, whole: Array, weights: Array) -> Array:
        grams = self._beside.get(whole)
        if grams is None:
            grams = self._beside.keep(whole, self.cells.grams(whole, self.spectrum))
        return (weights @ grams.reshape(len(weights), -1)).reshape(grams.shape[1:])


class Again:
    """Columns that one trial was asked about already; of those that are asked about again, what is needed."""

    def __init__(self, cells: Cells) -> None:
        self.cells = cells
        self._times, self._asked = OfArrays[int](), OfArrays[Asked]()

    @property
    def kept(self) -> int:
        """Of how many something is kept."""
        return len(self._asked)

    def of(self, columns: Array, spectrum: Callable[[Array], Array]) -> Asked | None:
        """What is kept of columns (n, C, k), once they were asked about ``ASKED_BEFORE`` times; until then None.

        Args:
            columns: as they are; an array that is asked about again is the same array.
            spectrum: what makes of them those of ``Asked``.
        """
        found = self._asked.get(columns)
        if found is None:
            times = self._times.get(columns) or 0
            if times >= rules.ASKED_BEFORE:
                return self._asked.keep(columns, Asked(self.cells, spectrum(columns)))
            self._times.keep(columns, times + 1)
        return found
