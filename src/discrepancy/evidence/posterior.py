"""What the data say of all columns for given prior variances and noise, and what more variance of a group would gain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular
from scipy.linalg.lapack import dpotri
from scipy.special import log_ndtr, logsumexp

from discrepancy.evidence.cells import Cells
from estimator.arrays import Array

OCTAVES = np.array([1.0, 0.5, 0.25, 0.125, 0.0625])


@dataclass(frozen=True)
class Group:
    """A cause at a place in one shape.

    Attributes:
        name: unique.
        cause, place: what and where.
        columns: indices.
        slab: prior standard deviation of each value if the cause is there, shape (k,).
        log_prior: relative to other groups.
        least: smallest value that is possible of each, -inf without a bound, shape (k,).
    """

    name: str
    cause: str
    place: str
    columns: tuple[int, ...]
    slab: tuple[float, ...]
    log_prior: float = 0.0
    least: tuple[float, ...] = ()


@dataclass(frozen=True, eq=False)
class Posterior:
    """Of columns x ~ N(0, S) and noise of one variance for each channel and band.

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
        return np.flatnonzero(self.prior > 0)

    @cached_property
    def weighted(self) -> tuple[Array, Array, float]:
        return self.cells.weighted(self.variance)

    @cached_property
    def _factor(self) -> tuple[Array, Array, Array]:
        """Scales s, lower Cholesky factor L of I + s G s, and z = L^-1 s b."""
        G, b, _ = self.weighted
        a = self.active
        s = np.sqrt(self.prior[a])
        A = s[:, None] * G[np.ix_(a, a)] * s
        A[np.diag_indices(len(a))] += 1.0
        L = cholesky(A, lower=True, overwrite_a=True, check_finite=False)
        return s, L, solve_triangular(L, s * b[a], lower=True, check_finite=False)

    @cached_property
    def log_evidence(self) -> float:
        """Of the rows, without the constant of pi."""
        _, L, z = self._factor
        yy = self.weighted[2]
        rows = self.cells.rows
        return float(-0.5 * (np.sum(rows * np.log(self.variance)) + yy - z @ z) - np.sum(np.log(np.diag(L))))

    @cached_property
    def mean(self) -> Array:
        s, L, z = self._factor
        x = np.zeros(self.cells.count)
        x[self.active] = s * solve_triangular(L, z, lower=True, trans=1, check_finite=False)
        return x

    @cached_property
    def covariance(self) -> Array:
        s, L, _ = self._factor
        inverse, _ = dpotri(L, lower=1)
        inverse = np.tril(inverse) + np.tril(inverse, -1).T
        out = np.zeros((self.cells.count, self.cells.count))
        out[np.ix_(self.active, self.active)] = s[:, None] * inverse * s
        return out

    def noise(self, floor: Array, weight: float) -> Array:
        """Better variances of the noise (MacKay's step): squares left over rows that are not fitted, about a floor."""
        left, fitted = self.cells.left(self.mean, self.covariance)
        free = np.maximum(self.cells.rows - fitted / self.variance, 0.05 * self.cells.rows)
        return (weight * floor + left) / (weight + free)

    @cached_property
    def conditional(self) -> tuple[Array, Array]:
        """Information matrix R and score Q of all columns given the active ones' priors, shapes (K, K) and (K,)."""
        s, L, z = self._factor
        G, b, _ = self.weighted
        U = solve_triangular(L, s[:, None] * G[self.active], lower=True, check_finite=False)
        return G - U.T @ U, b - U.T @ z

    def gain(self, group: Group, octaves: Array = OCTAVES) -> tuple[float, float]:
        """Log evidence that more variance of a group's columns adds, averaged over scales, and the best scale."""
        R, Q = self.conditional
        k = list(group.columns)
        Rg, Qg = R[np.ix_(k, k)], Q[k]
        slab = np.array(group.slab)
        each = []
        for scale in octaves:
            v = slab * scale
            A = np.eye(len(k)) + v[:, None] * Rg * v
            chol = np.linalg.cholesky(A)
            u = np.linalg.solve(chol, v * Qg)
            value = 0.5 * u @ u - np.sum(np.log(np.diag(chol)))
            if group.least:
                value += self._one_sided(group, v, A, Qg)
            each.append(value)
        return float(logsumexp(each) - np.log(len(octaves))), float(octaves[int(np.argmax(each))])

    def _one_sided(self, group: Group, v: Array, A: Array, Qg: Array) -> float:
        """Log of the share of the posterior that is possible over that of the prior, one value at a time."""
        covariance = v[:, None] * np.linalg.inv(A) * v
        mean = covariance @ Qg
        total = 0.0
        for value, se, least, size in zip(mean, np.sqrt(np.diag(covariance)), group.least, v, strict=True):
            if np.isfinite(least):
                total += float(log_ndtr((value - least) / se) - log_ndtr(-least / size))
        return total


@dataclass(frozen=True, eq=False)
class Noise:
    """How the noise is learnt: inverse gamma about a floor.

    Attributes:
        floor: variances, shape (C, bands).
        weight: observations that the floor counts.
    """

    floor: Array
    weight: float

    def learnt(self, posterior: Posterior, rounds: int) -> Posterior:
        """The posterior at the likeliest noise, after some steps of expectation and maximisation."""
        for _ in range(rounds):
            variance = posterior.noise(self.floor, self.weight)
            posterior = Posterior(posterior.cells, posterior.prior, variance)
        return posterior

    def log_prior(self, variance: Array) -> float:
        """Of the variances, up to a constant."""
        return float(-0.5 * self.weight * np.sum(np.log(variance / self.floor) + self.floor / variance))

    def evidence(self, posterior: Posterior) -> float:
        """Log evidence of the rows and of the noise."""
        return posterior.log_evidence + self.log_prior(posterior.variance)


def smoothed_floor(cells: Cells, squares: Array, passes: Sequence[float] = (0.25, 0.5, 0.25)) -> Array:
    """Variances from squares that a full fit leaves, smoothed over neighbouring bands in the logarithm."""
    log = np.log(squares / cells.rows)
    padded = np.pad(log, ((0, 0), (1, 1)), mode="edge")
    return np.exp(passes[0] * padded[:, :-2] + passes[1] * padded[:, 1:-1] + passes[2] * padded[:, 2:])
