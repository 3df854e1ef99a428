"""Sums of squares near a solution, and normal equations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from estimator.arrays import Array
from estimator.calibrate import rules


@dataclass(frozen=True, eq=False)
class Quadratic:
    """A sum of squares of whitened rows near some unknowns: chi2(dx) = c + 2 g . dx + dx . H dx.

    Attributes:
        index: which unknowns dx are.
        H, g, c: as above, shapes (k, k), (k,), ().
        count: rows in it.
    """

    index: NDArray[np.intp]
    H: Array
    g: Array
    c: float
    count: int

    @classmethod
    def of(cls, J: Array, residual: Array, covariance: Array, index: NDArray[np.intp]) -> Quadratic:
        """From rows (n, C), their derivative (n, C, k) and the covariance of their noise (n, C, C)."""
        factor = np.linalg.cholesky(covariance)
        white = np.linalg.solve(factor, np.concatenate([J, residual[..., None]], axis=2))
        flat = white.reshape(residual.size, -1)
        gram = flat.T @ flat
        return cls(index, gram[:-1, :-1], gram[:-1, -1], float(gram[-1, -1]), residual.size)

    @property
    def ratio(self) -> float:
        """chi2 over the number of rows; 0 without rows."""
        return self.c / max(1, self.count)

    @property
    def misfits(self) -> bool:
        """Whether that is more than noise leaves."""
        return self.ratio > max(rules.MISFIT, 1.0 + rules.MISFIT_SIGMAS * np.sqrt(2.0 / max(1, self.count)))

    def plus(self, other: Quadratic) -> Quadratic:
        """The sum of both, of the same unknowns."""
        return Quadratic(
            self.index, self.H + other.H, self.g + other.g, self.c + other.c, self.count + other.count
        )

    def at(self, dx: Array) -> float:
        """chi2 after a step of all unknowns, shape (K,)."""
        own = dx[self.index]
        return float(self.c + 2.0 * self.g @ own + own @ self.H @ own)

    def add_to(self, H: Array, g: Array) -> None:
        """Add to the normal equations of all unknowns."""
        H[np.ix_(self.index, self.index)] += self.H
        g[self.index] += self.g


def solved(H: Array, g: Array) -> tuple[Array, Array]:
    """Step -H^-1 g and H^-1 of normal equations whose unknowns have different units."""
    scale = 1.0 / np.sqrt(np.diag(H))
    factor = cho_factor(H * np.outer(scale, scale))
    return -scale * cho_solve(factor, scale * g), scale[:, None] * cho_solve(factor, np.diag(scale))
