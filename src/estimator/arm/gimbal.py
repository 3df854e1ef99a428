"""Kinematics of the passive gimbal: three axes through the wrist centre, z proximal, then y, then x.

Angles come in column order (theta_z, theta_y, theta_x) throughout;
R_bi = Rz(theta_z) Ry(theta_y) Rx(theta_x).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from estimator.apart import components, matrices, vectors
from estimator.arrays import Array


class Gimbal(NamedTuple):
    """A gimbal at given angles: their cosines and sines, shape (...) each.

    E = ``axes`` takes rates to the angular velocity, omega_i = E(theta) theta_dot.
    """

    cz: Array
    cy: Array
    cx: Array | float
    sz: Array
    sy: Array
    sx: Array | float

    @classmethod
    def at(cls, theta: ArrayLike) -> Gimbal:
        """At gimbal angles (theta_z, theta_y, theta_x) [rad], shape (..., 3)."""
        angles = components(theta)
        return cls(*np.cos(angles), *np.sin(angles))

    @property
    def before_x(self) -> Gimbal:
        """The same with theta_x at zero: its middle body."""
        return self._replace(cx=1.0, sx=0.0)

    def rotation(self) -> Array:
        """See ``rotation``."""
        cz, cy, cx, sz, sy, sx = self
        return matrices([
            [cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx],
            [sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx],
            [-sy, cy * sx, cy * cx],
        ])  # fmt: skip

    def axes(self) -> Array:
        """See ``rate_matrix``."""
        _, cy, cx, _, sy, sx = self
        return matrices([[-sy, 0.0, 1.0], [cy * sx, cx, 0.0], [cy * cx, -sx, 0.0]])

    def axes_dot(self, theta_dot: ArrayLike) -> Array:
        """See ``rate_matrix_dot``."""
        _, cy, cx, _, sy, sx = self
        _, y, x = components(theta_dot)
        return matrices([
            [-cy * y, 0.0, 0.0],
            [cy * cx * x - sy * sx * y, -sx * x, 0.0],
            [-cy * sx * x - sy * cx * y, -cx * x, 0.0],
        ])  # fmt: skip

    def motion(self, theta_dot: ArrayLike, theta_ddot: ArrayLike) -> tuple[Array, Array]:
        """See ``angular_motion``: E theta_dot and E theta_ddot + dE/dt theta_dot, without their zeros."""
        _, cy, cx, _, sy, sx = self
        z, y, x = components(theta_dot)
        zz, yy, xx = components(theta_ddot)
        along, across = cy * sx, cy * cx
        omega = vectors(x - sy * z, along * z + cx * y, across * z - sx * y)
        omega_dot = vectors(
            xx - sy * zz - cy * y * z,
            along * zz + cx * yy + ((across * x - sy * sx * y) * z - sx * x * y),
            across * zz - sx * yy - ((along * x + sy * cx * y) * z + cx * x * y),
        )
        return omega, omega_dot

    def about_axes(self, moment: Array) -> Array:
        """Torques about the axes (z, y, x) [N m] of a moment in {i} [N m]: E^T moment, shape (..., 3)."""
        _, cy, cx, _, sy, sx = self
        x, y, z = components(moment)
        return vectors(cy * sx * y + cy * cx * z - sy * x, cx * y - sx * z, x)

    def moment(self, torque: ArrayLike) -> Array:
        """See ``moment_about_axes``."""
        _, cy, cx, _, sy, sx = self
        about_z, about_y, about_x = components(torque)
        # {i} before its turn about x: there y is the middle axis, and the first axis is (-sin, 0, cos) of theta_y.
        up = (about_z + sy * about_x) / cy
        return vectors(about_x, cx * about_y + sx * up, cx * up - sx * about_y)


def rotation(theta: ArrayLike) -> Array:
    """Orientation g(theta) = R_bi of the grasp frame {i} in the base frame {b}, equation (28).

    Args:
        theta: gimbal angles (theta_z, theta_y, theta_x) [rad], shape (..., 3).

    Returns:
        Rotation matrices, shape (..., 3, 3).
    """
    return Gimbal.at(theta).rotation()


def rate_matrix(theta: ArrayLike) -> Array:
    """E(theta) of omega_i = E(theta) theta_dot; its columns are the z, y and x axes of the gimbal in {i}.

    Args:
        theta: gimbal angles (theta_z, theta_y, theta_x) [rad], shape (..., 3).

    Returns:
        E, dimensionless, shape (..., 3, 3); det E = -cos(theta_y), singular where theta_y = +-90 deg.
    """
    return Gimbal.at(theta).axes()


def rate_matrix_dot(theta: ArrayLike, theta_dot: ArrayLike) -> Array:
    """dE/dt [rad/s] along the motion, shape (..., 3, 3).

    Args:
        theta: gimbal angles (theta_z, theta_y, theta_x) [rad], shape (..., 3).
        theta_dot: their rates [rad/s], shape (..., 3).
    """
    return Gimbal.at(theta).axes_dot(theta_dot)


def angular_motion(theta: ArrayLike, theta_dot: ArrayLike, theta_ddot: ArrayLike) -> tuple[Array, Array]:
    """Angular velocity omega_i [rad/s] of {i} in {b}, expressed in {i}, and its derivative [rad/s^2].

    Args:
        theta: gimbal angles (theta_z, theta_y, theta_x) [rad], shape (..., 3).
        theta_dot: their rates [rad/s], shape (..., 3).
        theta_ddot: their accelerations [rad/s^2], shape (..., 3).

    Returns:
        omega and omega_dot, each of shape (..., 3).
    """
    return Gimbal.at(theta).motion(theta_dot, theta_ddot)


def moment_about_axes(theta: ArrayLike, torque: ArrayLike) -> Array:
    """The moment in {i} [N m] with given components about the gimbal's axes: E^-T torque, shape (..., 3).

    Args:
        theta: gimbal angles (theta_z, theta_y, theta_x) [rad], shape (..., 3).
        torque: about the axes, in that order [N m], shape (..., 3).
    """
    return Gimbal.at(theta).moment(torque)
