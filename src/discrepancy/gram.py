"""Gram matrices of rows, and rows without what a trial's own unknowns can explain."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def gram_of(a: Array, b: Array) -> Array:
    """a^T b over rows and channels, shapes (n, C, k), (n, C, l) -> (k, l)."""
    return a.reshape(-1, a.shape[2]).T @ b.reshape(-1, b.shape[2])


def project(x: Array, onto: Array) -> Array:
    """Take the columns ``onto`` out of x; shapes (n, C, k), (n, C, l)."""
    if onto.shape[2] == 0:
        return x
    u, d, _ = np.linalg.svd(onto.reshape(-1, onto.shape[2]), full_matrices=False)
    q = u[:, d > 1e-10 * d[0]]
    flat = x.reshape(-1, x.shape[2])
    return (flat - q @ (q.T @ flat)).reshape(x.shape)
