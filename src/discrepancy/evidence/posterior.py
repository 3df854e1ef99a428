"""What data say of all columns for given priors and noise, and what more variance of a group would gain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, get_lapack_funcs, solve_triangular
from scipy.special import log_ndtr, logsumexp

from discrepancy.evidence.cells import Cells
from estimator.arrays import Array


@dataclass(frozen=True)
class Group:
    """A cause at a place in one shape: columns whose values have a wide prior if it is there.

    Attributes:
        cause, place: what and where; groups of equal cause and place exclude each other.
        columns: indices, shape (k,).
        slab: prior standard deviation of each value, shape (k,).
        log_prior: relative to other groups.
        shape: numbers inside the columns.
        least: smallest possible value of each, -inf without a bound; empty where none has a bound.
        event: whether it acts for a while; its columns exist only while it is in the set.
        late: whether it is offered only where no other group is worth adding.
        family: groups of one family span each other and exclude each other; empty of those that have none.
        members: of a kind, the columns of each of its members; their values are alike by half of their variance.
    """

    cause: str
    place: str
    columns: tuple[int, ...]
    slab: tuple[float, ...]
    log_prior: float = 0.0
    shape: tuple[tuple[str, float], ...] = ()
    least: tuple[float, ...] = ()
    members: tuple[tuple[int, ...], ...] = ()
    event: bool = False
    late: bool = False
    family: str = ""

    @property
    def key(self) -> tuple[str, str]:
        """Cause and place."""
        return self.cause, self.place

    @property
    def name(self) -> str:
        """Cause, place and shape in words."""
        shape = ", ".join(f"{k} {v:g}" for k, v in self.shape)
        return f"{self.cause} at {self.place}" + (f" ({shape})" if shape else "")


@dataclass(frozen=True, eq=False)
class Posterior:
    """Posterior of columns x ~ N(0, S), with noise of one variance for each channel and band.

    Attributes:
        cells: the problem.
        prior: variances S, shape (K,); columns with zero are not in the model.
        variance: of the noise, shape (C, bands).
    """

    cells: Cells
    prior: Array
    variance: Array

    @cached_property
    def active(self) -> NDArray[np.intp]:
        """Columns in the model."""
        return np.flatnonzero(self.prior > 0)

    @cached_property
    def _weighted(self) -> tuple[Array, Array, float]:
        return self.cells.weighted(self.variance)

    @cached_property
    def _factor(self) -> tuple[Array, Array, Array]:
        """Scales s, lower Cholesky factor L of I + s G s, and z = L^-1 s b."""
        G, b, _ = self._weighted
        a = self.active
        s = np.sqrt(self.prior[a])
        A = s[:, None] * G[np.ix_(a, a)] * s
        A[np.diag_indices(len(a))] += 1.0
        L = cholesky(A, lower=True, overwrite_a=True, check_finite=False)
        return s, L, solve_triangular(L, s * b[a], lower=True, check_finite=False)

    @cached_property
    def log_evidence(self) -> float:
        """Log density of the rows, without the constant of pi."""
        _, L, z = self._factor
        yy = self._weighted[2]
        return float(
            -0.5 * (np.sum(self.cells.rows * np.log(self.variance)) + yy - z @ z) - np.sum(np.log(np.diag(L)))
        )

    @cached_property
    def mean(self) -> Array:
        """Values of all columns, shape (K,)."""
        s, L, z = self._factor
        x = np.zeros(len(self.prior))
        x[self.active] = s * solve_triangular(L, z, lower=True, trans=1, check_finite=False)
        return x

    @cached_property
    def covariance(self) -> Array:
        """Covariance of the values, shape (K, K)."""
        s, L, _ = self._factor
        (potri,) = get_lapack_funcs(("potri",), (L,))
        inverse, _ = potri(L, lower=1)
        inverse = np.tril(inverse) + np.tril(inverse, -1).T
        out = np.zeros((len(self.prior), len(self.prior)))
        out[np.ix_(self.active, self.active)] = s[:, None] * inverse * s
        return out

    def errors(self, columns: Sequence[int]) -> Array:
        """Standard deviations of the values of some columns that are in the model."""
        s, L, _ = self._factor
        at = np.searchsorted(self.active, columns)
        unit = np.zeros((len(s), len(at)))
        unit[at, np.arange(len(at))] = s[at]
        return np.sqrt(np.sum(solve_triangular(L, unit, lower=True, check_finite=False) ** 2, axis=0))

    def possible(self, group: Group, scale: float) -> float:
        """Log evidence that the bounds of a group's values add, where the group is in the model."""
        if not group.least:
            return 0.0
        return _possible(group, self.mean[list(group.columns)], self.errors(group.columns), scale)

    def better_noise(self, floor: Array, weight: Array | float) -> Array:
        """Variances by MacKay's step: squares left over rows that are not fitted, about a floor."""
        left, fitted = self.cells.left(self.mean, self.covariance)
        free = np.maximum(self.cells.rows - fitted / self.variance, 0.05 * self.cells.rows)
        return (weight * floor + left) / (weight + free)

    @cached_property
    def _conditional(self) -> tuple[Array, Array]:
        """Information matrix R and score Q of all columns beside the active ones' priors, shapes (K, K) and (K,)."""
        s, L, z = self._factor
        G, b, _ = self._weighted
        U = solve_triangular(L, s[:, None] * G[self.active], lower=True, check_finite=False)
        return G - U.T @ U, b - U.T @ z

    def errors_of(self, columns: Sequence[int]) -> Array:
        """Standard errors of columns that have no prior of their own, each beside everything else, shape (k,)."""
        R, _ = self._conditional
        return 1.0 / np.sqrt(np.maximum(np.diag(R)[list(columns)], 1e-30))

    def gain(self, group: Group, octaves: int) -> tuple[float, float]:
        """Log evidence that more variance of a group's columns adds, averaged over scales, and the best scale.

        With V the added covariance: (1/2) Q' (V^-1 + R)^-1 Q - (1/2) log |1 + V R|.
        """
        R, Q = self._conditional
        k = list(group.columns)
        Rg, Qg = R[np.ix_(k, k)], Q[k]
        root = prior_root(group)
        each = []
        for scale in 0.5 ** np.arange(octaves):
            B = root * scale
            A = np.eye(B.shape[1]) + B.T @ Rg @ B
            chol = np.linalg.cholesky(A)
            u = solve_triangular(chol, B.T @ Qg, lower=True, check_finite=False)
            value = 0.5 * u @ u - np.sum(np.log(np.diag(chol)))
            if group.least:
                covariance = B @ np.linalg.solve(A, B.T)
                value += _possible(group, covariance @ Qg, np.sqrt(np.diag(covariance)), scale)
            each.append(float(value))
        return float(logsumexp(each) - np.log(octaves)), float(0.5 ** int(np.argmax(each)))


def prior_root(group: Group) -> Array:
    """B with B B' the prior covariance of a group's values; members of a kind share half of their variance."""
    slab = np.array(group.slab)
    if not group.members:
        return np.diag(slab)
    at = {column: i for i, column in enumerate(group.columns)}
    common = np.zeros((len(slab), len(group.members[0])))
    for member in group.members:
        for p, column in enumerate(member):
            common[at[column], p] = slab[at[column]]
    return np.sqrt(0.5) * np.column_stack([np.diag(slab), common])


def _possible(group: Group, mean: Array, se: Array, scale: float) -> float:
    """Log of the share of the posterior that is possible over that of the prior, one value at a time."""
    total = 0.0
    for value, error, least, size in zip(mean, se, group.least, group.slab, strict=True):
        if np.isfinite(least):
            total += float(log_ndtr((value - least) / error) - log_ndtr(-least / (size * scale)))
    return total
