"""Arrays of numbers: type, memory layout, and the six parameters of an inertia matrix.

``vectors``, ``matrices`` and ``apart`` return the usual shape, with components in the last axes. Each component is
contiguous in memory, which makes arithmetic on 11,000 vectors three times as fast.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def vectors(*components: ArrayLike) -> Array:
    """Stack K components, each broadcastable to shape (...), into vectors (..., K)."""
    out = np.empty((len(components), *np.broadcast_shapes(*map(np.shape, components))))
    for k, component in enumerate(components):
        out[k] = component
    return out.transpose(*range(1, out.ndim), 0)


def matrices(rows: Sequence[Sequence[ArrayLike]]) -> Array:
    """Stack entries, each broadcastable to shape (...), into matrices (..., rows, columns)."""
    shape = np.broadcast_shapes(*(np.shape(entry) for row in rows for entry in row))
    out = np.empty((len(rows), len(rows[0]), *shape))
    for i, row in enumerate(rows):
        for k, entry in enumerate(row):
            out[i, k] = entry
    return out.transpose(*range(2, out.ndim), 0, 1)


def apart(x: Array, axes: int) -> Array:
    """Copy an array so that each component of the last one or two axes is contiguous in memory."""
    last, first = tuple(range(-axes, 0)), tuple(range(axes))
    return np.moveaxis(np.ascontiguousarray(np.moveaxis(x, last, first)), first, last)


def components(x: ArrayLike) -> Array:
    """Split vectors into components, shapes (..., K) -> (K, ...)."""
    x = np.asarray(x, dtype=float)
    return x.transpose(-1, *range(x.ndim - 1))


ORDER = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
"""Entries (row, column) of the six inertia parameters of equation (20): xx, xy, xz, yy, yz, zz."""


def inertia_matrix(parameters: Array) -> Array:
    """Return the symmetric matrix of the six parameters of (20), shape (6,) -> (3, 3)."""
    xx, xy, xz, yy, yz, zz = parameters
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def inertia_parameters(inertia: Array) -> Array:
    """Return the six parameters of (20) of a symmetric matrix, shape (3, 3) -> (6,)."""
    return np.array([inertia[k] for k in ORDER])


def point_inertia(r: Array) -> Array:
    """Return the inertia about the origin of 1 kg at a point ``r`` [m], shape (3,) -> (3, 3)."""
    return np.asarray(r @ r * np.eye(3) - np.outer(r, r))
