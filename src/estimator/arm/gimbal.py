"""Kinematics of the passive gimbal: three axes through the wrist centre, z proximal, then y, then x.

Angles come in column order (theta_z, theta_y, theta_x) throughout;
R_bi = Rz(theta_z) Ry(theta_y) Rx(theta_x).
"""

import numpy as np
from numpy.typing import ArrayLike

from estimator.arrays import Array


def rotation(theta: ArrayLike) -> Array:
    """Orientation g(theta) = R_bi of the grasp frame {i} in the base frame {b}, equation (28).

    Args:
        theta: gimbal angles (theta_z, theta_y, theta_x) [rad], shape (..., 3).

    Returns:
        Rotation matrices, shape (..., 3, 3).
    """
    (cz, cy, cx), (sz, sy, sx) = _cos_sin(theta)
    return _matrix(
        [cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx],
        [sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx],
        [-sy, cy * sx, cy * cx],
    )


def rate_matrix(theta: ArrayLike) -> Array:
    """E(theta) of omega_i = E(theta) theta_dot; its columns are the z, y and x axes of the gimbal in {i}.

    Args:
        theta: gimbal angles (theta_z, theta_y, theta_x) [rad], shape (..., 3).

    Returns:
        E, dimensionless, shape (..., 3, 3); det E = -cos(theta_y), singular where theta_y = +-90 deg.
    """
    (_, cy, cx), (_, sy, sx) = _cos_sin(theta)
    zero, one = np.zeros_like(cx), np.ones_like(cx)
    return _matrix([-sy, zero, one], [cy * sx, cx, zero], [cy * cx, -sx, zero])


def rate_matrix_dot(theta: ArrayLike, theta_dot: ArrayLike) -> Array:
    """dE/dt [rad/s] along the motion, shape (..., 3, 3).

    Args:
        theta: gimbal angles (theta_z, theta_y, theta_x) [rad], shape (..., 3).
        theta_dot: their rates [rad/s], shape (..., 3).
    """
    (_, cy, cx), (_, sy, sx) = _cos_sin(theta)
    _, y, x = np.moveaxis(np.asarray(theta_dot, dtype=float), -1, 0)
    zero = np.zeros_like(cx * x)
    return _matrix(
        [-cy * y, zero, zero],
        [cy * cx * x - sy * sx * y, -sx * x, zero],
        [-cy * sx * x - sy * cx * y, -cx * x, zero],
    )


def angular_motion(theta: ArrayLike, theta_dot: ArrayLike, theta_ddot: ArrayLike) -> tuple[Array, Array]:
    """Angular velocity omega_i [rad/s] of {i} in {b}, expressed in {i}, and its derivative [rad/s^2].

    Args:
        theta: gimbal angles (theta_z, theta_y, theta_x) [rad], shape (..., 3).
        theta_dot: their rates [rad/s], shape (..., 3).
        theta_ddot: their accelerations [rad/s^2], shape (..., 3).

    Returns:
        omega and omega_dot, each of shape (..., 3).
    """
    e = rate_matrix(theta)
    omega = _apply(e, theta_dot)
    return omega, _apply(e, theta_ddot) + _apply(rate_matrix_dot(theta, theta_dot), theta_dot)


def moment_about_axes(theta: ArrayLike, torque: ArrayLike) -> Array:
    """The moment in {i} [N m] with given components about the gimbal's axes: E^-T torque, shape (..., 3).

    Args:
        theta: gimbal angles (theta_z, theta_y, theta_x) [rad], shape (..., 3).
        torque: about the axes, in that order [N m], shape (..., 3).
    """
    (_, cy, cx), (_, sy, sx) = _cos_sin(theta)
    about_z, about_y, about_x = np.moveaxis(np.asarray(torque, dtype=float), -1, 0)
    # {i} before its turn about x: there y is the middle axis, and the first axis is (-sin, 0, cos) of theta_y.
    up = (about_z + sy * about_x) / cy
    x, y, z = np.broadcast_arrays(about_x, cx * about_y + sx * up, cx * up - sx * about_y)
    return np.stack([x, y, z], axis=-1)


def _apply(matrix: Array, vector: ArrayLike) -> Array:
    return np.einsum("...ij,...j->...i", matrix, np.asarray(vector, dtype=float))


def _cos_sin(theta: ArrayLike) -> tuple[Array, Array]:
    angles = np.moveaxis(np.asarray(theta, dtype=float), -1, 0)
    return np.cos(angles), np.sin(angles)


def _matrix(*rows: list[Array]) -> Array:
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
