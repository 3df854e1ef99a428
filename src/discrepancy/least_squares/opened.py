"""What a cause leaves open, such as friction at rest: unknowns of every trial of a known size, integrated out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from estimator.arrays import Array


@dataclass(frozen=True, eq=False)
class Opened:
    """Normal unknowns u with columns U in one trial; C channels, n rows.

    Rows y = U u + noise of unit power have the covariance I + size^2 U U^T, and (I + size^2 U U^T)^(-1/2) y is white
    again. With U = Q diag(s) V^T that is y - Q diag(f) Q^T y, f = 1 - 1 / sqrt(1 + size^2 s^2).

    Attributes:
        columns: of the unknowns in units of their size, as they were given, shape (n, C, k).
        basis: Q, shape (n, C, r).
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

    def __call__(self, x: Array) -> Array:
        """Rows that are white with these unknowns integrated out, shape (n, C, l) -> the same."""
        if not len(self.shrink) or not x.size:
            return x
        q, flat = self.basis.reshape(-1, len(self.shrink)), x.reshape(-1, x.shape[2])
        return np.asarray(flat - q @ (self.shrink[:, None] * (q.T @ flat))).reshape(x.shape)


def through(opened: Sequence[Opened], x: Array) -> Array:
    """Rows with the unknowns of one cause after the other integrated out."""
    for one in opened:
        x = one(x)
    return x
