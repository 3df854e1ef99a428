"""Dynamics of one Omnid arm: passive gimbal, inverse dynamics, and wrench on the payload.

Gimbal angles have the column order (theta_z, theta_y, theta_x): z is proximal, then y, then x, all through the wrist
centre. The spring torque drives the arm's own bodies and the payload. The torque of the arm's bodies is computed from
the motion and subtracted (derivation: docs/method-arm.md). The paper (section IV.B) uses f_i = (dh/dphi)^-T tau_i for
an arm without mass. The motor's rotor is on the other side of the spring and does not enter.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from estimator.arm.delta import LEG_DIRECTIONS, LegGeometry, leg_geometry, wrist_motion
from estimator.arm.design import Triple
from estimator.arm.unit import Arms
from estimator.arrays import Array, components, matrices, vectors
from estimator.so3 import cross, times


class Gimbal(NamedTuple):
    """Cosines and sines of gimbal angles (theta_z, theta_y, theta_x), shape (...) each.

    R_bi = Rz(theta_z) Ry(theta_y) Rx(theta_x).
    """

    cz: Array
    cy: Array
    cx: Array | float
    sz: Array
    sy: Array
    sx: Array | float

    @classmethod
    def at(cls, theta: ArrayLike) -> Gimbal:
        """Make the gimbal at angles [rad], shape (..., 3)."""
        angles = components(theta)
        return cls(*np.cos(angles), *np.sin(angles))

    @property
    def before_x(self) -> Gimbal:
        """The gimbal with theta_x = 0: the frame of its middle body."""
        return self._replace(cx=1.0, sx=0.0)

    def rotation(self) -> Array:
        """Return the orientation R_bi of the grasp frame {i} in the base frame {b}, equation (28), (..., 3, 3)."""
        cz, cy, cx, sz, sy, sx = self
        return matrices([
            [cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx],
            [sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx],
            [-sy, cy * sx, cy * cx],
        ])  # fmt: skip

    def axes(self) -> Array:
        """Return E of omega_i = E theta_dot, shape (..., 3, 3): its columns are the z, y and x gimbal axes in {i}.

        det E = -cos(theta_y), so E is singular at theta_y = +-90 deg.
        """
        _, cy, cx, _, sy, sx = self
        return matrices([[-sy, 0.0, 1.0], [cy * sx, cx, 0.0], [cy * cx, -sx, 0.0]])

    def motion(self, theta_dot: ArrayLike, theta_ddot: ArrayLike) -> tuple[Array, Array]:
        """Return angular velocity [rad/s] of {i} in {b}, expressed in {i}, and its derivative [rad/s^2], (..., 3).

        These are E theta_dot and E theta_ddot + dE/dt theta_dot, without multiplications by zero.
        """
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
        """Return torques about the axes (z, y, x) [N m] of a moment in {i} [N m]: E^T moment, shape (..., 3)."""
        _, cy, cx, _, sy, sx = self
        x, y, z = components(moment)
        return vectors(cy * sx * y + cy * cx * z - sy * x, cx * y - sx * z, x)

    def moment(self, torque: ArrayLike) -> Array:
        """Return the moment in {i} [N m] with given torques about axes (z, y, x) [N m]: E^-T torque, (..., 3)."""
        _, cy, cx, _, sy, sx = self
        about_z, about_y, about_x = components(torque)
        # In {i} before the rotation about x, y is the middle axis and the first axis is (-sin, 0, cos) of theta_y.
        up = (about_z + sy * about_x) / cy
        return vectors(about_x, cx * about_y + sx * up, cx * up - sx * about_y)


def rotation(theta: ArrayLike) -> Array:
    """Return ``Gimbal.rotation`` at gimbal angles [rad], shape (..., 3)."""
    return Gimbal.at(theta).rotation()


def rate_matrix(theta: ArrayLike) -> Array:
    """Return ``Gimbal.axes`` at gimbal angles [rad], shape (..., 3)."""
    return Gimbal.at(theta).axes()


def angular_motion(theta: ArrayLike, theta_dot: ArrayLike, theta_ddot: ArrayLike) -> tuple[Array, Array]:
    """Return ``Gimbal.motion`` at gimbal angles [rad], with their rates and accelerations, shape (..., 3) each."""
    return Gimbal.at(theta).motion(theta_dot, theta_ddot)


def moment_about_axes(theta: ArrayLike, torque: ArrayLike) -> Array:
    """Return ``Gimbal.moment`` at gimbal angles [rad], shape (..., 3)."""
    return Gimbal.at(theta).moment(torque)


def arm_torque(
    phi: ArrayLike,
    phi_dot: ArrayLike,
    phi_ddot: ArrayLike,
    design: Arms,
    legs: LegGeometry | None = None,
    h_ddot: Array | None = None,
    base_ddot: Array | None = None,
) -> Array:
    """Return the spring torques that move the unloaded arm [N m], positive raising the link, shape (..., 3).

    They include the driven links, the rods as uniform slender bodies, and all bodies that translate with the wrist.
    The gimbal's bodies are balanced, so their rotation does not affect the driven joints.

    Args:
        phi, phi_dot, phi_ddot: driven angles [rad], rates and accelerations, shape (..., 3) each.
        design: parameters of the robot.
        legs, h_ddot: geometry at ``phi`` and the wrist's acceleration [m/s^2], if known.
        base_ddot: acceleration of a driving base in the arm's frame [m/s^2], shape (..., 3), which acts like gravity.

    Raises:
        InputError: no wrist position exists at some configuration.
    """
    phi, phi_dot, phi_ddot = (np.asarray(a, dtype=float) for a in (phi, phi_dot, phi_ddot))
    legs = leg_geometry(phi, design) if legs is None else legs
    up = np.asarray(design.up)
    g = design.gravity_mps2 * up + (0.0 if base_ddot is None else base_ddot)
    h_ddot = wrist_motion(legs, phi_dot, phi_ddot)[1] if h_ddot is None else h_ddot
    knee_ddot = legs.knee_d1 * phi_ddot[..., None] + legs.knee_d2 * (phi_dot**2)[..., None]
    # Consistent mass of a slender rod: T = m/6 (va.va + va.vb + vb.vb), with half of the weight at each end.
    wrist_ddot = h_ddot[..., None, :]
    rod_mass = np.asarray(design.rod_mass_kg)[..., None]
    at_knee = rod_mass * ((2.0 * knee_ddot + wrist_ddot) / 6.0 + g[..., None, :] / 2.0)
    at_wrist = rod_mass * ((knee_ddot + 2.0 * wrist_ddot) / 6.0 + g[..., None, :] / 2.0)
    wrist_force = at_wrist.sum(axis=-2) + design.wrist_mass_kg * (h_ddot + g)
    link = design.proximal_mass_kg * design.gravity_mps2 * design.proximal_com_m
    up = up if base_ddot is None else g / design.gravity_mps2
    link_weight = link * np.cos(phi) * up[..., 2:] - link * np.sin(phi) * (up @ LEG_DIRECTIONS.T)
    return (
        design.proximal_inertia_kgm2 * phi_ddot
        + link_weight
        + np.sum(legs.knee_d1 * at_knee, axis=-1)
        + legs.along_rods(wrist_force)
    )


def gimbal_torque(
    theta: ArrayLike, theta_dot: ArrayLike, theta_ddot: ArrayLike, design: Arms, gimbal: Gimbal | None = None
) -> Array:
    """Return the torques about the gimbal axes that move its own bodies [N m], order (z, y, x), shape (..., 3).

    Args:
        theta, theta_dot, theta_ddot: gimbal angles [rad], rates and accelerations, shape (..., 3) each.
        design: parameters of the robot.
        gimbal: the gimbal at ``theta``, if known.
    """
    gimbal = Gimbal.at(theta) if gimbal is None else gimbal
    theta_dot, theta_ddot = np.asarray(theta_dot, dtype=float), np.asarray(theta_ddot, dtype=float)
    yoke = design.yoke_inertia_kgm2[2] * theta_ddot[..., 0]
    # The ring's frame is {i} before the x rotation: the same formulas with theta_x and its rates at zero.
    no_x = np.array([1.0, 1.0, 0.0])
    ring = _rotor_torque(gimbal.before_x, theta_dot * no_x, theta_ddot * no_x, design.ring_inertia_kgm2)
    flange = _rotor_torque(gimbal, theta_dot, theta_ddot, design.flange_inertia_kgm2)
    return vectors(yoke + ring[..., 0] + flange[..., 0], ring[..., 1] + flange[..., 1], flange[..., 2])


def wrench_on_payload(
    phi: tuple[ArrayLike, ArrayLike, ArrayLike],
    theta: tuple[ArrayLike, ArrayLike, ArrayLike],
    tau: ArrayLike,
    design: Arms,
    legs: LegGeometry | None = None,
    gimbal: Gimbal | None = None,
    R_bi: Array | None = None,
    h_ddot: Array | None = None,
    base_ddot: Array | None = None,
) -> Array:
    """Return the wrench (m_i [N m], f_i [N]) of the robot ON the payload at the origin of {i}, in {i}, shape (..., 6).

    f_i = R_bi^T (dh/dphi)^-T (tau - arm_torque); the gimbal is passive, so m_i = -E^-T gimbal_torque.

    Args:
        phi: driven angles [rad], rates and accelerations, each of shape (..., 3).
        theta: gimbal angles (theta_z, theta_y, theta_x) [rad], rates and accelerations, each (..., 3).
        tau: spring torques [N m], shape (..., 3).
        design: parameters of the robot.
        legs, gimbal, R_bi, h_ddot: geometry at ``phi``, gimbal and orientation at ``theta`` and the wrist's
            acceleration [m/s^2], if known.
        base_ddot: as in ``arm_torque``.

    Raises:
        InputError: no wrist position exists at some configuration.
    """
    legs = leg_geometry(phi[0], design) if legs is None else legs
    gimbal = Gimbal.at(theta[0]) if gimbal is None else gimbal
    R_bi = gimbal.rotation() if R_bi is None else R_bi
    f_b = legs.at_wrist(np.asarray(tau) - arm_torque(*phi, design, legs, h_ddot, base_ddot))
    f_i = times(np.swapaxes(R_bi, -1, -2), f_b)
    m_i = -gimbal.moment(gimbal_torque(*theta, design, gimbal))
    return vectors(*components(m_i), *components(f_i))


def _rotor_torque(gimbal: Gimbal, theta_dot: Array, theta_ddot: Array, inertia: Triple) -> Array:
    """Return joint torques E^T (I omega_dot + omega x I omega) of one balanced body fixed in {i}."""
    omega, omega_dot = gimbal.motion(theta_dot, theta_ddot)
    principal = np.array(inertia)
    return gimbal.about_axes(principal * omega_dot + cross(omega, principal * omega))
