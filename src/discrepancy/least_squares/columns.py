"""Many columns of one trial's rows, in pieces that problems share: one with other columns copies none of the rest.

They are kept in the cells' cosine transform, without what the trial's own unknowns can explain (and with how much of
these was taken out, so that rows come back as they were). Many are kept in files, in single precision: rounding,
6e-8 of a number, is far below the noise of 1 for whatever a fit takes out of them; sums are made in double precision.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import cast

import numpy as np

from discrepancy.least_squares.cells import Cells
from discrepancy.least_squares.gram import added_up, gram_of, project
from discrepancy.least_squares.stored import given_back, stored
from estimator.arrays import Array


@dataclass(frozen=True, eq=False)
class Piece:
    """Some successive columns of those that were made together.

    Attributes:
        whole: these, shape (n, C, columns).
        at: which of them.
    """

    whole: Array
    at: slice

    @classmethod
    def of(cls, whole: Array) -> Piece:
        """All of them."""
        return cls(whole, slice(0, whole.shape[2]))

    @property
    def x(self) -> Array:
        """The columns, shape (n, C, k)."""
        return self.whole[..., self.at]

    @property
    def width(self) -> int:
        """How many there are."""
        return int(self.at.stop - self.at.start)

    def cut(self, start: int, stop: int) -> Piece:
        """Some of them."""
        return Piece(self.whole, slice(self.at.start + start, self.at.start + stop))


@dataclass(frozen=True, eq=False)
class Columns:
    """Columns of one trial.

    Attributes:
        pieces: successive columns.
        inside: what the trial's own unknowns explain of them, by those's orthonormal columns, shape (l, columns).
    """

    pieces: tuple[Piece, ...]
    inside: Array

    @classmethod
    def of(cls, x: Array, own: Array, cells: Cells) -> Columns:
        """From rows (n, C, columns) and the orthonormal columns (n, C, l) of the trial's own unknowns."""
        return cls((Piece.of(cells.spectrum(project(x, own))),), gram_of(own, x))

    @property
    def width(self) -> int:
        """How many columns there are."""
        return self.inside.shape[1]

    @property
    def nbytes(self) -> int:
        """What the pieces take in double precision."""
        return sum(8 * piece.x.size for piece in self.pieces)

    @property
    def is_single(self) -> bool:
        """Whether they are in single precision."""
        return self.pieces[0].whole.dtype == np.float32

    def single(self) -> Columns:
        """The same in single precision, and in files."""
        pieces = [cast(Array, stored(piece.x.astype(np.float32, copy=False))) for piece in self.pieces]
        return Columns(tuple(map(Piece.of, pieces)), self.inside)

    def beside(self, others: Columns) -> Columns:
        """These columns, and then others of the same trial."""
        return Columns((*self.pieces, *others.pieces), np.concatenate([self.inside, others.inside], axis=1))

    def take(self, span: slice) -> Array:
        """Some successive columns, shape (n, C, k)."""
        start, stop, _ = span.indices(self.width)
        parts, at = [], 0
        for piece in self.pieces:
            end = at + piece.width
            if at < stop and start < end:
                parts.append(piece.x[..., max(start - at, 0) : stop - at])
            at = end
        if not parts:
            return np.zeros((*self.pieces[0].whole.shape[:2], 0))
        return np.asarray(parts[0] if len(parts) == 1 else np.concatenate(parts, axis=2), dtype=np.float64)

    def channels(self, first: int) -> Array:
        """All columns, of channels from one on, shape (n, C - first, columns)."""
        return np.concatenate([piece[:, first:] for piece in self._read()], axis=2, dtype=np.float64)

    def times(self, x: Array) -> Array:
        """The columns added up, each by its number in x, shape (columns,) or (columns, k) -> (n, C) or (n, C, k)."""
        out, at = np.zeros((*self.pieces[0].whole.shape[:2], *x.shape[1:])), 0
        for piece in self._read():
            out += added_up(piece, x[at : at + piece.shape[2]])
            at += piece.shape[2]
        return out

    def products(self, b: Array) -> Array:
        """Products with other columns b, over rows and channels, shape (n, C, k) -> (columns, k)."""
        return np.concatenate([gram_of(piece, b) for piece in self._read()])

    def grams(self, cells: Cells, b: Array) -> Array:
        """The same over every cell, shape (n, C, k) -> (K, columns, k)."""
        return np.concatenate([cells.grams(piece, b) for piece in self._read()], axis=1)

    def own_grams(self, cells: Cells) -> Array:
        """Gram matrices over every cell, shape (K, columns, columns)."""
        out = np.zeros((len(cells.sizes), self.width, self.width))
        pieces = [piece.x for piece in self.pieces]
        ends = np.cumsum([0, *(piece.shape[2] for piece in pieces)])
        spans = [slice(*pair) for pair in pairwise(ends)]
        for k, one in enumerate(pieces):
            for other, at in zip(pieces[: k + 1], spans[: k + 1], strict=True):
                gram = cells.grams(one, other)
                out[:, spans[k], at], out[:, at, spans[k]] = gram, np.swapaxes(gram, 1, 2)
                given_back(other)
            given_back(one)
        return out

    def _read(self) -> Iterator[Array]:
        """Each of the pieces, whose memory is given back once the next is asked for."""
        for piece in self.pieces:
            yield piece.x
            given_back(piece.whole)

    def replaced(self, start: int, stop: int, new: Columns) -> Columns:
        """With new columns in place of those from ``start`` to ``stop``, which may be none."""
        kind = self.pieces[0].whole.dtype
        middle = [Piece.of(piece.x.astype(kind, copy=False)) for piece in new.pieces]
        inside = [self.inside[:, :start], new.inside, self.inside[:, stop:]]
        return Columns(
            (*self._cut(0, start), *middle, *self._cut(stop, self.width)), np.concatenate(inside, axis=1)
        )

    def _cut(self, start: int, stop: int) -> list[Piece]:
        out, at = [], 0
        for piece in self.pieces:
            end = at + piece.width
            if at < stop and start < end:
                out.append(piece.cut(max(start - at, 0), min(stop, end) - at))
            at = end
        return out


def held(trials: Sequence[Columns], most_bytes: float) -> list[Columns]:
    """All trials' columns, in single precision if they take more memory than they should."""
    if sum(columns.nbytes for columns in trials) <= most_bytes:
        return list(trials)
    return [columns.single() for columns in trials]


def portions(columns: Iterable[Array], most_bytes: float) -> Iterator[Array]:
    """Successive columns (n, C, k) put together, (n, C, columns), as many as take so much memory but at least one."""
    together: list[Array] = []
    for one in columns:
        together.append(one)
        if sum(each.nbytes for each in together) >= most_bytes:
            yield np.concatenate(together, axis=2)
            together = []
    if together:
        yield np.concatenate(together, axis=2)
