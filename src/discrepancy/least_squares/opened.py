"""What a cause leaves open, such as friction at rest: unknowns of every trial of a known size, integrated out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from discrepancy import rules
from discrepancy.least_squares.cells import Cells
from discrepancy.least_squares.gram import added_up, gram_of
from discrepancy.least_squares.stored import stored
from estimator.arrays import Array


@dataclass(frozen=True, eq=False)
class Opened:
    """Normal unknowns u with columns U in one trial; C channels, n rows.

    Rows y = U u + noise of unit power have the covariance I + size^2 U U^T, and (I + size^2 U U^T)^(-1/2) y is white
    again. With U = Q diag(s) V^T that is y - Q diag(f) Q^T y, f = 1 - 1 / sqrt(1 + size^2 s^2).

    Attributes:
        columns: of the unknowns that show, turned so that there is one for each of the basis, shape (n, C, r).
        basis: Q, of the rows that ``of`` was given as ``left``: here in the cells' transform, shape (n, C, r).
        stretch: s, shape (r,).
        size: standard deviation of the unknowns.
    """

    columns: Array
    basis: Array
    stretch: Array
    size: float

    @classmethod
    def of(cls, columns: Array, size: float, left: Array | None = None) -> Opened:
        """Unknowns of a size.

        Args:
            columns: shape (n, C, k), possibly k = 0.
            size: standard deviation of their values.
            left: what other unknowns leave of these columns, where there are such; the same shape.
        """
        rows = columns if left is None else left
        if not np.any(rows):
            return cls(columns[..., :0], np.zeros((*columns.shape[:2], 0)), np.zeros(0), size)
        flat = rows.reshape(-1, rows.shape[2])
        # Of their products, as of all rows it takes many times as long; so small an s is still known to 1e-8 of the
        # largest. Of knots closer than rows many leave nothing beside others; turned, unknowns still scatter as one.
        squares, V = np.linalg.eigh(flat.T @ flat)
        keep = squares > rules.OPEN_SHOWS**2 * squares[-1]
        s, V = np.sqrt(squares[keep]), V[:, keep]
        return cls(columns @ V, (flat @ (V / s)).reshape(*columns.shape[:2], -1), s, size)

    @property
    def scaled(self) -> Array:
        """Columns of unknowns whose standard deviation is 1."""
        return self.size * self.columns

    @cached_property
    def shrink(self) -> Array:
        """f, shape (r,)."""
        return 1.0 - (1.0 + (self.size * self.stretch) ** 2) ** -0.5

    @property
    def price(self) -> float:
        """Log sqrt det of the covariance [nats]."""
        return 0.5 * float(np.sum(np.log1p((self.size * self.stretch) ** 2)))

    def single(self) -> Opened:
        """The same in single precision, and in files."""
        columns, basis = (stored(x.astype(np.float32)) for x in (self.columns, self.basis))
        return replace(self, columns=columns, basis=basis)

    def along(self, x: Array) -> Array:
        """How much of columns lies along the unknowns, and is taken out, shape (n, C, l) -> (r, l)."""
        if not len(self.stretch):
            return np.zeros((0, x.shape[2]))
        return self.shrink[:, None] * gram_of(self.basis, x)

    def __call__(self, x: Array) -> Array:
        """Rows that are white with these unknowns integrated out, shape (n, C, l) -> the same."""
        if not len(self.stretch) or not x.size:
            return x
        return np.asarray(x - added_up(self.basis, self.along(x)))


@dataclass(frozen=True, eq=False)
class Along:
    """A trial's columns along unknowns, by cell of its noise: made once, for unknowns of whatever size.

    Attributes:
        opened: the unknowns, of any size.
        cells: of the trial.
        edge: products of their basis with all columns over every cell, shape (K, r, columns).
    """

    opened: Opened
    cells: Cells
    edge: Array

    def of_size(self, size: float) -> tuple[Opened, Array, Callable[[int], Array]]:
        """The unknowns of a size, what lies along them (r, columns), what a cell's Gram matrix loses, one by one."""
        opened = replace(self.opened, size=size)
        # All cells together: the transform is orthonormal.
        shares = opened.shrink[:, None] * self.edge.sum(axis=0)
        basis = opened.basis.reshape(self.cells.index.size, -1)

        def lost(cell: int) -> Array:
            # Products of the basis with itself, cell by cell, would be the largest arrays of a diagnosis.
            taken = basis[self.cells.numbers(cell)] @ shares
            cross = shares.T @ self.edge[cell]
            return np.asarray(cross + cross.T - taken.T @ taken)

        return opened, shares, lost


def through(opened: Sequence[Opened], x: Array) -> Array:
    """Rows with the unknowns of one cause after the other integrated out."""
    for one in opened:
        x = one(x)
    return x
