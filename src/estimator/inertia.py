"""The six parameters of an inertia matrix (paper, equation (20))."""

import numpy as np

from estimator.arrays import Array

ORDER = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
"""Entries (row, column) of the six inertia parameters of equation (20): xx, xy, xz, yy, yz, zz."""


def inertia_matrix(parameters: Array) -> Array:
    """Symmetric matrix of the six parameters of (20), shape (6,) -> (3, 3)."""
    xx, xy, xz, yy, yz, zz = parameters
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def inertia_parameters(inertia: Array) -> Array:
    """The six parameters of (20) of a symmetric matrix, shape (3, 3) -> (6,)."""
    return np.array([inertia[k] for k in ORDER])
