"""Rotation matrices of vectors and single angles, and the rates that belong to them."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from independent.numerics import Array, derivative, second_derivative


def from_rotvec(vector: Array) -> Array:
    """Rotation matrices of rotation vectors [rad], (..., 3) to (..., 3, 3)."""
    flat = Rotation.from_rotvec(np.reshape(vector, (-1, 3))).as_matrix()
    return flat.reshape(*np.shape(vector), 3)


def about(axis: int, angle: Array) -> Array:
    """Rotation matrices about axis 0, 1 or 2 by angles [rad], (...,) to (..., 3, 3)."""
    vector = np.zeros((*np.shape(angle), 3))
    vector[..., axis] = angle
    return from_rotvec(vector)


def spin(R: Array) -> tuple[Array, Array]:
    """Angular velocity and acceleration [rad/s, rad/s^2] in the fixed frame, of R (Q, 3, 3), shape (Q, 3) each."""
    back = np.swapaxes(R, -1, -2)
    # R'' R^T is the acceleration's cross product plus a symmetric part, which drops out of the difference.
    return _axial(derivative(R) @ back), _axial(second_derivative(R) @ back)


def turned(R: Array, vector: Array) -> Array:
    """R @ vector for stacks that broadcast, shapes (..., 3, 3) and (..., 3)."""
    return np.einsum("...ij,...j->...i", R, vector)


def back_turned(R: Array, vector: Array) -> Array:
    """R^T @ vector, as ``turned``."""
    return np.einsum("...ji,...j->...i", R, vector)


def _axial(S: Array) -> Array:
    pairs = ((2, 1), (0, 2), (1, 0))
    return np.stack([(S[..., a, b] - S[..., b, a]) / 2 for a, b in pairs], axis=-1)
