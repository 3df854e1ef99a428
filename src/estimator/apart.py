"""Vectors and matrices whose components lie apart in memory, one array each: numpy's loops are then long.

Their shapes are the usual ones, components in the last axes; what numpy makes of them element by element lies as they
do. Of 11,000 samples, arithmetic on vectors that lie side by side takes three times as long.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from estimator.arrays import Array


def vectors(*components: ArrayLike) -> Array:
    """Vectors of K components, each of shape (...) or what broadcasts to it -> (..., K)."""
    out = np.empty((len(components), *np.broadcast_shapes(*map(np.shape, components))))
    for k, component in enumerate(components):
        out[k] = component
    return out.transpose(*range(1, out.ndim), 0)


def matrices(rows: Sequence[Sequence[ArrayLike]]) -> Array:
    """Matrices (..., rows, columns) of entries, each of shape (...) or what broadcasts to it."""
    shape = np.broadcast_shapes(*(np.shape(entry) for row in rows for entry in row))
    out = np.empty((len(rows), len(rows[0]), *shape))
    for i, row in enumerate(rows):
        for k, entry in enumerate(row):
            out[i, k] = entry
    return out.transpose(*range(2, out.ndim), 0, 1)


def apart(x: Array, axes: int) -> Array:
    """The same numbers with the components of the last one or two axes apart."""
    last, first = tuple(range(-axes, 0)), tuple(range(axes))
    return np.moveaxis(np.ascontiguousarray(np.moveaxis(x, last, first)), first, last)


def components(x: ArrayLike) -> Array:
    """Components of vectors, shapes (..., K) -> (K, ...)."""
    x = np.asarray(x, dtype=float)
    return x.transpose(-1, *range(x.ndim - 1))
