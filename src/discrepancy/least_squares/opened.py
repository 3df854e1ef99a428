"""What a cause leaves open, such as friction at rest: unknowns of every trial of a known size, integrated out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from discrepancy.least_squares.gram import added_up, gram_of
from estimator.arrays import Array


@dataclass(frozen=True, eq=False)
class Opened:
    """Normal unknowns u with columns U in one trial; C channels, n rows.

    Rows y = U u + noise of unit power have the covariance I + size^2 U U^T, and (I + size^2 U U^T)^(-1/2) y is white
    again. With U = Q diag(s) V^T that is y - Q diag(f) Q^T y, f = 1 - 1 / sqrt(1 + size^2 s^2).

    Attributes:
        columns: of the unknowns in units of their size, as they were given, shape (n, C, k).
        basis: Q, of the rows that ``of`` was given as ``left``: here in the cells' transform, shape (n, C, r).
        shrink: f, shape (r,).
        price: log sqrt det of the covariance [nats].
    """

    columns: Array
    basis: Array
    shrink: Array
    price: float

    @classmethod
    def of(cls, columns: Array, size: float, left: Array | None = None) -> Opened:
        """Unknowns of a size.

        Args:
            columns: shape (n, C, k), possibly k = 0.
            size: standard deviation of their values.
            left: what other unknowns leave of these columns, where there are such; the same shape.
        """
        given = size * columns
        scaled = given if left is None else size * left
        if not np.any(scaled):
            return cls(given, np.zeros((*columns.shape[:2], 0)), np.zeros(0), 0.0)
        flat = scaled.reshape(-1, scaled.shape[2])
        u, s, _ = np.linalg.svd(flat, full_matrices=False)
        keep = s > 1e-6 * max(s[0], 1.0)
        variance = 1.0 + s[keep] ** 2
        basis = np.ascontiguousarray(u[:, keep]).reshape(*columns.shape[:2], -1)
        return cls(given, basis, 1.0 - variance**-0.5, 0.5 * float(np.sum(np.log(variance))))

    def single(self) -> Opened:
        """The same in single precision."""
        return replace(self, columns=self.columns.astype(np.float32), basis=self.basis.astype(np.float32))

    def along(self, x: Array) -> Array:
        """How much of columns lies along the unknowns, and is taken out, shape (n, C, l) -> (r, l)."""
        if not len(self.shrink):
            return np.zeros((0, x.shape[2]))
        return self.shrink[:, None] * gram_of(self.basis, x)

    def __call__(self, x: Array) -> Array:
        """Rows that are white with these unknowns integrated out, shape (n, C, l) -> the same."""
        if not len(self.shrink) or not x.size:
            return x
        return np.asarray(x - added_up(self.basis, self.along(x)))


def through(opened: Sequence[Opened], x: Array) -> Array:
    """Rows with the unknowns of one cause after the other integrated out."""
    for one in opened:
        x = one(x)
    return x
