"""Posterior of all columns for given priors and noise, and the evidence gain of a group with more prior variance."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import get_lapack_funcs
from scipy.special import log_ndtr

from discrepancy.evidence.cells import Cells
from estimator.arrays import Array

_potrf, _potri, _trtrs = get_lapack_funcs(("potrf", "potri", "trtrs"), (np.zeros(1),))


@dataclass(frozen=True)
class Group:
    """A cause at a place in one shape: columns with a wide prior (a slab) if the cause is present.

    Attributes:
        cause, place: groups with equal cause and place exclude each other.
        columns: indices, shape (k,).
        slab: prior standard deviation of each value, shape (k,).
        log_prior: log prior probability relative to other groups.
        shape: named parameters that the columns depend on nonlinearly.
        least: lower bound of each value, -inf without a bound; empty if no value has a bound.
        event: whether it acts for a limited time; its columns exist only while it is in the set.
        late: whether it is an unlisted law, in no table of causes.
        family: groups of one family explain each other and exclude each other; empty: no family.
        members: for a cause at all joints, the columns of each joint. Half of the prior variance is common to them.
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
    def second(self) -> bool:
        """Whether the search offers it only if no listed, lasting cause is worth adding."""
        return self.event or self.late

    @property
    def identity(self) -> tuple[str, str, tuple[tuple[str, float], ...]]:
        """Cause, place and shape."""
        return self.cause, self.place, self.shape

    @property
    def name(self) -> str:
        """Cause, place and shape in words; of a long shape the first numbers."""
        shape = ", ".join(f"{k} {v:g}" for k, v in self.shape[:3])
        return f"{self.cause} at {self.place}" + (f" ({shape})" if shape else "")


@dataclass(frozen=True, eq=False)
class Arrow:
    """Block Cholesky factor of I + s G s, whose blocks couple only through the last columns.

    Attributes:
        parts: positions of each block.
        last: positions of the columns that all blocks share.
        own: factor of each block, then of the last columns.
        beside: coupling of each block with the last columns.
    """

    parts: list[NDArray[np.intp]]
    last: NDArray[np.intp]
    own: list[Array]
    beside: list[Array]

    @classmethod
    def of(cls, G: Array, s: Array, parts: list[NDArray[np.intp]], last: NDArray[np.intp]) -> Arrow:
        """Factor I + s G s with column scales s."""

        def block(i: NDArray[np.intp], k: NDArray[np.intp]) -> Array:
            return s[i][:, None] * G[i[:, None], k] * s[k]

        rest = block(last, last)
        own, beside = [], []
        for p in parts:
            own.append(_factor(block(p, p)))
            beside.append(_solved(own[-1], block(p, last)))
            rest -= beside[-1].T @ beside[-1]
        own.append(_factor(rest))
        return cls(parts, last, own, beside)

    @property
    def half_log_det(self) -> float:
        """Half the log determinant of the matrix."""
        return float(sum(np.sum(np.log(np.diag(L))) for L in self.own))

    def forward(self, x: Array) -> Array:
        """L^-1 x, shape (n, k)."""
        out, rest = np.empty_like(x), x[self.last].copy()
        for p, L, B in zip(self.parts, self.own, self.beside, strict=False):
            out[p] = _solved(L, x[p])
            rest -= B.T @ out[p]
        out[self.last] = _solved(self.own[-1], rest)
        return out

    def backward(self, z: Array) -> Array:
        """L'^-1 z, shape (n, k)."""
        out = np.empty_like(z)
        out[self.last] = _solved(self.own[-1], z[self.last], trans=1)
        for p, L, B in zip(self.parts, self.own, self.beside, strict=False):
            out[p] = _solved(L, z[p] - B @ out[self.last], trans=1)
        return out

    def inverses(self) -> Iterator[tuple[NDArray[np.intp], Array]]:
        """For each block, the positions of it and the last columns, and that block of the inverse."""
        last = _inverse(self.own[-1])
        for p, L, B in zip(self.parts, self.own, self.beside, strict=False):
            E = _solved(L, B, trans=1)
            cross = E @ last
            yield np.append(p, self.last), np.block([[_inverse(L) + cross @ E.T, -cross], [-cross.T, last]])


def _factor(A: Array) -> Array:
    """Lower Cholesky factor of I + A."""
    A[np.diag_indices(len(A))] += 1.0
    if not len(A):
        return A
    L, failed = _potrf(A, lower=1)
    if failed:
        raise np.linalg.LinAlgError("the matrix is not positive definite")
    return L


def _solved(L: Array, x: Array, trans: int = 0) -> Array:
    """L^-1 x, or L'^-1 x if ``trans`` is 1."""
    return _trtrs(L, x, lower=1, trans=trans)[0] if x.size else x


def _inverse(L: Array) -> Array:
    """(L L')^-1."""
    if not len(L):
        return L
    half = np.tril(_potri(L, lower=1)[0])
    return half + np.tril(half, -1).T


@dataclass(frozen=True, eq=False)
class Posterior:
    """Posterior of columns x ~ N(0, S), with one noise variance for each channel and band.

    Attributes:
        cells: the problem.
        prior: variances S, shape (K,); columns with zero variance are not in the model.
        variance: noise variances, shape (C, bands).
    """

    cells: Cells
    prior: Array
    variance: Array

    @cached_property
    def active(self) -> NDArray[np.intp]:
        """Indices of the columns in the model."""
        return np.flatnonzero(self.prior > 0)

    @cached_property
    def _own(self) -> Cells:
        return self.cells.only(self.active)

    @cached_property
    def _weighted(self) -> tuple[Array, Array, float]:
        return self._own.weighted(self.variance)

    @cached_property
    def _factor(self) -> tuple[Array, Arrow, Array]:
        """Scales s, Cholesky factor L of I + s G s, and z = L^-1 s b."""
        G, b, _ = self._weighted
        s, owner = np.sqrt(self.prior[self.active]), self._own.owners
        parts = [np.flatnonzero(owner == c) for c in range(len(self.cells.channels))]
        L = Arrow.of(G, s, parts, np.flatnonzero(owner < 0))
        return s, L, L.forward((s * b)[:, None])[:, 0]

    @cached_property
    def log_evidence(self) -> float:
        """Log density of the rows, without the constant in pi."""
        _, L, z = self._factor
        yy = self._weighted[2]
        return float(-0.5 * (np.sum(self.cells.rows * np.log(self.variance)) + yy - z @ z) - L.half_log_det)

    @cached_property
    def mean(self) -> Array:
        """Posterior mean of all columns, shape (K,)."""
        s, L, z = self._factor
        x = np.zeros(len(self.prior))
        x[self.active] = s * L.backward(z[:, None])[:, 0]
        return x

    @cached_property
    def covariance(self) -> Array:
        """Posterior covariance, shape (K, K)."""
        s, L, _ = self._factor
        inverse = L.forward(np.eye(len(s)))
        out = np.zeros((len(self.prior), len(self.prior)))
        out[np.ix_(self.active, self.active)] = s[:, None] * (inverse.T @ inverse) * s
        return out

    @cached_property
    def _blocks(self) -> list[Array]:
        """For each channel, the covariance of its columns in the model."""
        s, L, _ = self._factor
        where, out = np.zeros(len(s), dtype=np.intp), []
        for (k, inverse), channel in zip(L.inverses(), self._own.channels, strict=True):
            where[k] = np.arange(len(k))
            pick, scale = where[channel.columns], s[channel.columns]
            out.append(scale[:, None] * inverse[pick[:, None], pick] * scale)
        return out

    @cached_property
    def variances(self) -> Array:
        """Posterior variances, shape (K,)."""
        own, out = self.prior[self.active], np.zeros(len(self.prior))  # a column without rows keeps it
        for block, channel in zip(self._blocks, self._own.channels, strict=True):
            own[channel.columns] = np.diag(block)
        out[self.active] = own
        return out

    @cached_property
    def left(self) -> tuple[Array, Array]:
        """Squared residuals at the mean, and the squares that the covariance explains, shape (C, bands) each."""
        return self._own.left(self.mean[self.active], self._blocks)

    def worth(self, columns: Sequence[int], less: Array) -> float:
        """Log evidence lost if columns have the smaller prior variances ``less``, at the same noise."""
        s, L, z = self._factor
        k = np.searchsorted(self.active, columns)
        Z = L.forward(np.eye(len(s))[:, k])
        C = np.linalg.inv(Z.T @ Z)  # I + s R s, in units of the prior
        h, root, R = C @ (Z.T @ z), np.sqrt(less) / s[k], C - np.eye(len(k))
        A = np.eye(len(k)) + root[:, None] * R * root
        kept = root * h @ np.linalg.solve(A, root * h) - np.linalg.slogdet(A)[1]
        return float(0.5 * (h @ (Z.T @ z) - np.linalg.slogdet(C)[1] - kept))

    def size(self, columns: Sequence[int]) -> float:
        """Half the squared contribution of columns at their mean, over the noise variance."""
        k = np.searchsorted(self.active, columns)
        x = self.mean[list(columns)]
        return float(0.5 * x @ self._weighted[0][np.ix_(k, k)] @ x)

    def possible(self, group: Group, scale: float) -> float:
        """Log evidence gained from the bounds of a group's values, if the group is in the model."""
        if not group.least:
            return 0.0
        k = list(group.columns)
        return float(_possible(group, self.mean[k], np.sqrt(self.variances[k]), scale))

    def better_noise(self, floor: Array, weight: Array | float) -> Array:
        """Update the noise by MacKay's step: squared residuals over effective free rows, weighted with the floor."""
        left, fitted = self.left
        free = np.maximum(self.cells.rows - fitted / self.variance, 0.05 * self.cells.rows)
        return (weight * floor + left) / (weight + free)

    @cached_property
    def _conditional(self) -> tuple[Array, Array]:
        """Information matrix R (K, K) and score Q (K,) of all columns, with the active ones marginalised."""
        s, L, z = self._factor
        G, b, _ = self.cells.weighted(self.variance)
        U = L.forward(s[:, None] * G[self.active])
        return G - U.T @ U, b - U.T @ z

    def conditional(self, columns: NDArray[np.intp]) -> tuple[Array, Array]:
        """Information matrix (k, k) and score (k,) of columns outside the model, with those in it marginalised."""
        R, Q = self._conditional
        return R[np.ix_(columns, columns)], Q[columns]

    def errors_of(self, columns: Sequence[int]) -> Array:
        """Standard errors of columns without a prior, each beside the active ones, shape (k,)."""
        R, _ = self._conditional
        return 1.0 / np.sqrt(np.maximum(np.diag(R)[list(columns)], 1e-30))

    def gain(self, group: Group, octaves: int) -> tuple[float, float]:
        """Log evidence gained by more prior variance of a group's columns, averaged over scales, and the best scale.

        With V the added covariance: (1/2) Q' (V^-1 + R)^-1 Q - (1/2) log |1 + V R|.
        """
        R, Q = self._conditional
        k = np.array(group.columns)
        root, scales = prior_root(group), np.array([0.5**k for k in range(octaves)])
        size, turn = np.linalg.eigh(root.T @ R[k[:, None], k] @ root)
        turn = root @ turn
        u, more = turn.T @ Q[k], scales[:, None] ** 2
        gained = more / (1.0 + more * np.maximum(size, 0.0))
        each = 0.5 * gained @ u**2 + 0.5 * np.sum(np.log(gained / more), axis=1)
        if group.least:
            each += _possible(group, gained * u @ turn.T, np.sqrt(gained @ turn.T**2), scales[:, None])
        most = each.max()
        return float(most + np.log(np.mean(np.exp(each - most)))), float(scales[np.argmax(each)])


def prior_root(group: Group) -> Array:
    """B such that B B' is the prior covariance of a group's values; joints share half of their variance."""
    slab = np.array(group.slab)
    if not group.members:
        return np.diag(slab)
    at = {column: i for i, column in enumerate(group.columns)}
    common = np.zeros((len(slab), len(group.members[0])))
    for member in group.members:
        for p, column in enumerate(member):
            common[at[column], p] = slab[at[column]]
    return np.sqrt(0.5) * np.column_stack([np.diag(slab), common])


def _possible(group: Group, mean: Array, se: Array, scale: Array | float) -> Array:
    """Log of the posterior over the prior probability that the bounds hold, one value at a time."""
    least, slab = np.array(group.least), np.array(group.slab)
    k = np.isfinite(least) & np.all(se > 0.0, axis=tuple(range(se.ndim - 1)))
    share = log_ndtr((mean[..., k] - least[k]) / se[..., k]) - log_ndtr(-least[k] / (slab[k] * scale))
    return np.sum(share, axis=-1)
