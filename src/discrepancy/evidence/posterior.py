"""What data say of all columns for given priors and noise, and what more variance of a group would gain."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular
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
    def identity(self) -> tuple[str, str, tuple[tuple[str, float], ...]]:
        """Cause, place and shape."""
        return self.cause, self.place, self.shape

    @property
    def name(self) -> str:
        """Cause, place and shape in words."""
        shape = ", ".join(f"{k} {v:g}" for k, v in self.shape)
        return f"{self.cause} at {self.place}" + (f" ({shape})" if shape else "")


@dataclass(frozen=True, eq=False)
class Arrow:
    """Cholesky factor of I + s G s, whose parts meet only in the columns that come last.

    Attributes:
        parts: positions of each part.
        last: positions of the columns that all parts share.
        own: factor of each part, and the last one's.
        beside: what each part has in common with the last.
    """

    parts: list[NDArray[np.intp]]
    last: NDArray[np.intp]
    own: list[Array]
    beside: list[Array]

    @classmethod
    def of(
        cls,
        G: Array,
        active: NDArray[np.intp],
        s: Array,
        parts: list[NDArray[np.intp]],
        last: NDArray[np.intp],
    ) -> Arrow:
        """Factor of I + s G s for the active columns and their scales s."""

        def block(i: NDArray[np.intp], k: NDArray[np.intp]) -> Array:
            return s[i][:, None] * G[np.ix_(active[i], active[k])] * s[k]

        rest = block(last, last) + np.eye(len(last))
        own, beside = [], []
        for p in parts:
            own.append(
                cholesky(block(p, p) + np.eye(len(p)), lower=True, overwrite_a=True, check_finite=False)
            )
            beside.append(solve_triangular(own[-1], block(p, last), lower=True, check_finite=False))
            rest -= beside[-1].T @ beside[-1]
        own.append(cholesky(rest, lower=True, overwrite_a=True, check_finite=False))
        return cls(parts, last, own, beside)

    @property
    def half_log_det(self) -> float:
        """Half the logarithm of the matrix's determinant."""
        return float(sum(np.sum(np.log(np.diag(L))) for L in self.own))

    def forward(self, x: Array) -> Array:
        """L^-1 x, shape (n, k)."""
        out, rest = np.empty_like(x), x[self.last].copy()
        for p, L, B in zip(self.parts, self.own, self.beside, strict=False):
            out[p] = solve_triangular(L, x[p], lower=True, check_finite=False)
            rest -= B.T @ out[p]
        out[self.last] = solve_triangular(self.own[-1], rest, lower=True, check_finite=False)
        return out

    def backward(self, z: Array) -> Array:
        """L'^-1 z, shape (n,)."""
        out = np.empty_like(z)
        out[self.last] = solve_triangular(self.own[-1], z[self.last], lower=True, trans=1, check_finite=False)
        for p, L, B in zip(self.parts, self.own, self.beside, strict=False):
            out[p] = solve_triangular(L, z[p] - B @ out[self.last], lower=True, trans=1, check_finite=False)
        return out

    def inverses(self) -> Iterator[tuple[NDArray[np.intp], Array]]:
        """Positions of each part with the last one, and that block of the inverse."""
        root = solve_triangular(self.own[-1], np.eye(len(self.last)), lower=True, check_finite=False)
        last = root.T @ root
        for p, L, B in zip(self.parts, self.own, self.beside, strict=False):
            E = solve_triangular(L, B, lower=True, trans=1, check_finite=False)
            root = solve_triangular(L, np.eye(len(p)), lower=True, check_finite=False)
            cross = E @ last
            yield np.append(p, self.last), np.block([[root.T @ root + cross @ E.T, -cross], [-cross.T, last]])


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
    def _factor(self) -> tuple[Array, Arrow, Array]:
        """Scales s, Cholesky factor L of I + s G s, and z = L^-1 s b."""
        G, b, _ = self._weighted
        a = self.active
        s = np.sqrt(self.prior[a])
        owner = self.cells.owners[a]
        parts = [np.flatnonzero(owner == c) for c in range(len(self.cells.channels))]
        L = Arrow.of(G, a, s, parts, np.flatnonzero(owner < 0))
        return s, L, L.forward((s * b[a])[:, None])[:, 0]

    @cached_property
    def log_evidence(self) -> float:
        """Log density of the rows, without the constant of pi."""
        _, L, z = self._factor
        yy = self._weighted[2]
        return float(-0.5 * (np.sum(self.cells.rows * np.log(self.variance)) + yy - z @ z) - L.half_log_det)

    @cached_property
    def mean(self) -> Array:
        """Values of all columns, shape (K,)."""
        s, L, z = self._factor
        x = np.zeros(len(self.prior))
        x[self.active] = s * L.backward(z)
        return x

    @cached_property
    def covariance(self) -> Array:
        """Covariance of the values, shape (K, K)."""
        s, L, _ = self._factor
        inverse = L.forward(np.eye(len(s)))
        out = np.zeros((len(self.prior), len(self.prior)))
        out[np.ix_(self.active, self.active)] = s[:, None] * (inverse.T @ inverse) * s
        return out

    @cached_property
    def blocks(self) -> list[Array]:
        """Covariance of the values that each channel sees, in the order of its columns."""
        s, L, _ = self._factor
        at, out = np.full(self.cells.count, -1), []  # columns may have been added since
        at[self.active] = np.arange(len(s))
        for own, channel in zip(L.inverses(), self.cells.channels, strict=True):
            place = at[channel.columns]
            seen = np.flatnonzero(place >= 0)
            k, inverse = own
            where = np.zeros(len(s), dtype=np.intp)
            where[k] = np.arange(len(k))
            pick = where[place[seen]]
            block = np.zeros((len(place), len(place)))
            block[np.ix_(seen, seen)] = s[place[seen], None] * inverse[np.ix_(pick, pick)] * s[place[seen]]
            out.append(block)
        return out

    @cached_property
    def variances(self) -> Array:
        """Variances of the values, shape (K,)."""
        out = np.zeros(self.cells.count)
        for block, channel in zip(self.blocks, self.cells.channels, strict=True):
            out[channel.columns] = np.diag(block)
        return out[: len(self.prior)]

    def possible(self, group: Group, scale: float) -> float:
        """Log evidence that the bounds of a group's values add, where the group is in the model."""
        if not group.least:
            return 0.0
        return _possible(
            group, self.mean[list(group.columns)], np.sqrt(self.variances[list(group.columns)]), scale
        )

    def better_noise(self, floor: Array, weight: Array | float) -> Array:
        """Variances by MacKay's step: squares left over rows that are not fitted, about a floor."""
        left, fitted = self.cells.left(self.mean, self.blocks)
        free = np.maximum(self.cells.rows - fitted / self.variance, 0.05 * self.cells.rows)
        return (weight * floor + left) / (weight + free)

    @cached_property
    def _conditional(self) -> tuple[Array, Array]:
        """Information matrix R and score Q of all columns beside the active ones' priors, shapes (K, K) and (K,)."""
        s, L, z = self._factor
        G, b, _ = self._weighted
        U = L.forward(s[:, None] * G[self.active])
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
        if np.isfinite(least) and error > 0.0:
            total += float(log_ndtr((value - least) / error) - log_ndtr(-least / (size * scale)))
    return total
