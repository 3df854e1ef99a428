"""Gram matrices of rows, and rows without what a trial's own unknowns can explain."""

from collections.abc import Iterator

import numpy as np

from discrepancy import rules
from estimator.arrays import Array


def gram_of(a: Array, b: Array) -> Array:
    """a^T b over rows and channels, in double precision, shapes (n, C, k), (n, C, l) -> (k, l)."""
    count = a.shape[0] * a.shape[1]
    return flat_gram(a.reshape(count, a.shape[2]), b.reshape(count, b.shape[2]))


def flat_gram(a: Array, b: Array) -> Array:
    """The same of shapes (n, k), (n, l)."""
    if a.dtype == b.dtype == np.float64:
        return a.T @ b
    out = np.zeros((a.shape[1], b.shape[1]))
    for part in _parts(len(a)):
        wide = a[part].astype(np.float64)
        out += wide.T @ (wide if a is b else b[part])
    return out


def added_up(a: Array, x: Array) -> Array:
    """The columns of a, each times its number in x, in double precision, shapes (n, C, k), (k, ...) -> (n, C, ...)."""
    if a.dtype == np.float64:
        return a @ x
    count = a.shape[0] * a.shape[1]
    flat, out = a.reshape(count, a.shape[2]), np.empty((count, *x.shape[1:]))
    for part in _parts(count):
        out[part] = flat[part].astype(np.float64) @ x
    return out.reshape(*a.shape[:2], *x.shape[1:])


def _parts(count: int) -> Iterator[slice]:
    return (slice(start, start + rules.WIDENED_ROWS) for start in range(0, count, rules.WIDENED_ROWS))


def orthonormal(columns: Array) -> Array:
    """Orthonormal columns that span the same, shape (n, C, l) -> (n, C, rank)."""
    if columns.shape[2] == 0:
        return columns
    u, d, _ = np.linalg.svd(columns.reshape(-1, columns.shape[2]), full_matrices=False)
    kept = u[:, d > 1e-10 * d[0]]
    return np.ascontiguousarray(kept).reshape(*columns.shape[:2], -1)


def project(x: Array, off: Array) -> Array:
    """Take the orthonormal columns ``off`` out of x; shapes (n, C, k), (n, C, l)."""
    if off.shape[2] == 0 or x.shape[2] == 0:
        return x
    q, flat = off.reshape(-1, off.shape[2]), x.reshape(-1, x.shape[2])
    return np.asarray(flat - q @ (q.T @ flat)).reshape(x.shape)


def flat_inverse(H: Array) -> Array:
    """Inverse of a symmetric matrix (k, k), unit scales removed; directions that it leaves flat get nought."""
    diagonal = np.diag(H)
    # What is nothing at all has no scale: rounding in its place would be made huge.
    scale = np.where(diagonal > 1e-300, 1.0 / np.sqrt(np.maximum(diagonal, 1e-300)), 0.0)
    values, vectors = np.linalg.eigh(H * np.outer(scale, scale))
    inverse = np.where(values > 1e-11 * values[-1:], 1.0 / np.maximum(values, 1e-300), 0.0)
    return np.asarray((vectors * inverse) @ vectors.T * np.outer(scale, scale))
