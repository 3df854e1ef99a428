"""Convert an arm's joint signals to pose, twist and wrench at its grasp, with derivatives by the signals."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimator.arm.delta import LegGeometry, jacobian_of, leg_geometry, wrist_motion
from estimator.arm.dynamics import Gimbal, arm_torque, gimbal_torque, wrench_on_payload
from estimator.arm.unit import AT, Arms, ArmUnit
from estimator.arrays import Array, apart, components, matrices
from estimator.so3 import cross, times


class Kind(NamedTuple):
    """Three of the 21 signals of one robot at an instant, one per joint.

    ``step`` is the step of a finite difference, in their unit.
    """

    name: str
    unit: str
    step: float


KINDS = (
    Kind("phi", "rad", 1e-6),
    Kind("phi_dot", "rad/s", 1e-5),
    Kind("phi_ddot", "rad/s^2", 1e-4),
    Kind("theta", "rad", 1e-6),
    Kind("theta_dot", "rad/s", 1e-5),
    Kind("theta_ddot", "rad/s^2", 1e-4),
    Kind("tau", "N m", 1e-4),
)
COUNT = 3 * len(KINDS)
STEPS = np.repeat([kind.step for kind in KINDS], 3)
PHI, PHI_DOT, PHI_DDOT, THETA, THETA_DOT, THETA_DDOT, TAU = (slice(k, k + 3) for k in range(0, COUNT, 3))


def with_its_rates(angle: slice) -> slice:
    """Extend ``PHI`` or ``THETA`` to the slice with rates and accelerations."""
    return slice(angle.start, angle.start + 9)


class ArmData(NamedTuple):
    """Pose, twist and wrench of one arm at its grasp; leading axes are samples, or anything else.

    Attributes:
        R_bi: orientation of {i} in the arm's base frame, shape (..., 3, 3).
        h: wrist position in that frame [m], shape (..., 3).
        twist: body twist (omega_i [rad/s], v_i [m/s]) in {i}, equation (29), shape (..., 6).
        twist_dot: its component-wise time derivative, shape (..., 6).
        wrench: (m_i [N m], f_i [N]) of the arm ON the payload at the origin of {i}, in {i}, shape (..., 6).
    """

    R_bi: Array
    h: Array
    twist: Array
    twist_dot: Array
    wrench: Array


def arm_data(
    phi: tuple[Array, Array, Array], theta: tuple[Array, Array, Array], tau: Array, arm: Arms,
    base: Array | None = None,
) -> ArmData:  # fmt: skip
    """Compute kinematics and dynamics of an arm (paper, equations (28)-(29), section IV.B).

    Args:
        phi: driven angles [rad], rates and accelerations, each of shape (..., 3).
        theta: gimbal angles (z, y, x) [rad], rates and accelerations, each (..., 3).
        tau: spring torques [N m], shape (..., 3).
        arm: parameters of the arm; their leading axes correspond to those of the angles.
        base: pose (x, y [m], yaw [rad]) of a driving base in its {b} at the start, with rates and accelerations, shape
            (..., 9). Pose, twist and wrench then are those of the grasp in that frame. None for a base that stands.

    Raises:
        InputError: no wrist position exists at some configuration.
    """
    legs = leg_geometry(phi[0], arm)
    h_dot, h_ddot = wrist_motion(legs, phi[1], phi[2])
    if base is not None:
        return _driven_arm(phi, theta, tau, arm, legs, (h_dot, h_ddot), base)
    gimbal = Gimbal.at(theta[0])
    R_bi = gimbal.rotation()
    R_ib = np.swapaxes(R_bi, -1, -2)
    omega, omega_dot = gimbal.motion(theta[1], theta[2])
    v = times(R_ib, h_dot)
    v_dot = times(R_ib, h_ddot) - cross(omega, v)
    wrench = wrench_on_payload(phi, theta, tau, arm, legs, gimbal, R_bi, h_ddot)
    return ArmData(
        R_bi, legs.h, np.concatenate([omega, v], axis=-1), np.concatenate([omega_dot, v_dot], axis=-1), wrench
    )


def _driven_arm(
    phi: tuple[Array, Array, Array], theta: tuple[Array, Array, Array], tau: Array, arm: Arms,
    legs: LegGeometry, wrist: tuple[Array, Array], base: Array,
) -> ArmData:  # fmt: skip
    """Return ``arm_data`` on a driving base.

    The base's yaw adds to theta_z, which turns about the same vertical. Its acceleration acts on the arm like gravity;
    of what its rotation adds, the wrist's part counts (links and rods move across it by less than 0.01 N).
    """
    yaw = [
        np.stack([x, *np.zeros((2, *x.shape))], axis=-1) for x in (base[..., 2], base[..., 5], base[..., 8])
    ]
    theta = theta[0] + yaw[0], theta[1] + yaw[1], theta[2] + yaw[2]
    about, faster = yaw[1][..., :1], yaw[2][..., :1]
    S, across = yaw_matrix(base[..., 2]), np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    h_dot = wrist[0] + about * (legs.h @ across)
    h_ddot = wrist[1] + faster * (legs.h @ across) + about * ((wrist[0] + h_dot) @ across)
    planar = np.array([1.0, 1.0, 0.0])
    base_dot, base_ddot = base[..., 3:6] * planar, base[..., 6:9] * planar
    gimbal = Gimbal.at(theta[0])
    R, R_back = gimbal.rotation(), np.swapaxes(S, -1, -2)
    R_ib = np.swapaxes(R, -1, -2)
    omega, omega_dot = gimbal.motion(theta[1], theta[2])
    v = times(R_ib, times(S, h_dot) + base_dot)
    v_dot = times(R_ib, times(S, h_ddot) + base_ddot) - cross(omega, v)
    pushed = wrench_on_payload(
        phi, theta, tau, arm, legs, gimbal, R_back @ R, h_ddot, times(R_back, base_ddot)
    )
    twist, twist_dot = np.concatenate([omega, v], axis=-1), np.concatenate([omega_dot, v_dot], axis=-1)
    return ArmData(R, times(S, legs.h) + base[..., :3] * planar, twist, twist_dot, pushed)


def yaw_matrix(yaw: Array) -> Array:
    """Return rotations about z by angles [rad], shape (...) -> (..., 3, 3)."""
    cos, sin, zero = np.cos(yaw), np.sin(yaw), np.zeros_like(yaw)
    return matrices([[cos, -sin, zero], [sin, cos, zero], [zero, zero, zero + 1.0]])


LENGTHS: NDArray[np.intp] = np.r_[AT["radius"], AT["proximal_length"], AT["rod_length"]]
MASSES: NDArray[np.intp] = np.r_[AT["proximal_mass_ratio"], AT["rod_mass_ratio"], AT["wrist_mass_ratio"]]
TILT: NDArray[np.intp] = np.r_[AT["tilt"]]
BY_UNIT: NDArray[np.intp] = np.concatenate([LENGTHS, MASSES, TILT])
"""Deviations that affect more than the sensor readings."""
_LENGTH, _MASS, _TILT = 1e-6, 1e-4, 1e-6  # steps of finite differences
_NONE = np.zeros(3)
_Wrist = tuple[Array, Array, Array, Array]
"""Wrist position [m], velocity, acceleration and force on the payload [N], in the arm's own frame."""


class ArmChanges:
    """Derivatives of ``robot_data`` of one arm at n instants.

    Nonlinear parts use finite differences, each restricted to what it affects. Driven angles move only the legs,
    gimbal angles only the gimbal, and masses only the arm's torques. The remaining steps (see ``arm_data``),
    accelerations and torques are linear.
    """

    def __init__(self, s: Array, unit: ArmUnit) -> None:
        """Take true signals s, shape (n, ``SLOTS``), within the arm's reach."""
        self._s, self._unit = apart(s, 1), unit
        self._legs = leg_geometry(self._at(PHI), unit)
        self._wrist = self._at_wrist(self._legs, self._at(PHI), self._at(PHI_DOT), unit)
        self._gimbal = Gimbal.at(self._at(THETA))
        self._R = self._gimbal.rotation()
        self._R_ib = np.swapaxes(self._R, -1, -2)
        self._turning = self._turn(self._gimbal, self._at(THETA_DOT), self._at(THETA_DDOT))
        self._v = times(self._R_ib, self._wrist[1])

    def by_signals(self) -> ArmData:
        """Return derivatives by the signals in their order, shapes (``SLOTS``, n, ...)."""
        phi, phi_dot, phi_ddot = self._at(PHI), self._at(PHI_DOT), self._at(PHI_DDOT)
        moved = _each(phi, step := STEPS[PHI][0])
        parts = [
            self._driven(self._at_wrist(leg_geometry(moved, self._unit), moved, phi_dot, self._unit), step)
        ]
        moved = _each(phi_dot, step := STEPS[PHI_DOT][0])
        parts.append(self._driven(self._at_wrist(self._legs, phi, moved, self._unit), step))
        # Accelerations enter linearly.
        h, h_dot, h_ddot, force = self._wrist
        faster = h_ddot + np.moveaxis(jacobian_of(self._legs), -1, 0)
        torque = arm_torque(phi, phi_dot, _each(phi_ddot, 1.0), self._unit, self._legs, faster)
        pushed = self._legs.at_wrist(self._at(TAU) - torque)
        parts.append(self._driven((h, h_dot, faster, pushed), 1.0))

        theta, rate, faster = self._at(THETA), self._at(THETA_DOT), self._at(THETA_DDOT)
        gimbal = Gimbal.at(_each(theta, step := STEPS[THETA][0]))
        d_R = (gimbal.rotation() - self._R) / step
        parts.append(self._turned(d_R, self._turn(gimbal, rate, faster), step))
        none = np.zeros_like(d_R)
        moved = _each(rate, step := STEPS[THETA_DOT][0])
        parts.append(self._turned(none, self._turn(self._gimbal, moved, faster), step))
        parts.append(self._turned(none, self._turn(self._gimbal, rate, _each(faster, 1.0)), 1.0))

        along_rods = np.moveaxis(self._legs.rod / self._legs.leverage[..., None], -2, 0)
        parts.append(self._driven((h, h_dot, h_ddot, force + along_rods), 1.0))
        return self._levelled(parts)

    def by_unit(self) -> ArmData:
        """Return derivatives by the deviations ``BY_UNIT``, shapes (their number, n, ...)."""
        phi, phi_dot = self._at(PHI), self._at(PHI_DOT)
        longer = self._deviating(LENGTHS, _LENGTH)
        legs = leg_geometry(np.broadcast_to(phi, (len(LENGTHS), *phi.shape)), longer)
        parts = [self._driven(self._at_wrist(legs, phi, phi_dot, longer), _LENGTH)]
        for places, step in ((MASSES, _MASS), (TILT, _TILT)):
            parts.append(
                self._driven(self._at_wrist(self._legs, phi, phi_dot, self._deviating(places, step)), step)
            )
        out = self._levelled(parts)
        turned = (self._deviating(TILT, _TILT).R_ba - self._unit.R_ba) / _TILT
        out.R_bi[-2:] += turned @ self._R
        out.h[-2:] += times(turned, self._wrist[0])
        return out

    def _at(self, slots: slice) -> Array:
        return self._s[:, slots]

    def _deviating(self, places: NDArray[np.intp], step: float) -> ArmUnit:
        x = np.tile(self._unit.x, (len(places), 1, 1))
        x[np.arange(len(places)), 0, places] += step
        return ArmUnit(self._unit.design, x)

    def _at_wrist(self, legs: LegGeometry, phi: Array, phi_dot: Array, unit: ArmUnit) -> _Wrist:
        phi_ddot = self._at(PHI_DDOT)
        h_dot, h_ddot = wrist_motion(legs, phi_dot, phi_ddot)
        torque = arm_torque(phi, phi_dot, phi_ddot, unit, legs, h_ddot)
        return legs.h, h_dot, h_ddot, legs.at_wrist(self._at(TAU) - torque)

    def _turn(self, gimbal: Gimbal, rate: Array, faster: Array) -> tuple[Array, Array, Array]:
        """Return angular velocity, its derivative, and the moment on the payload, in {i}."""
        torque = gimbal_torque(np.empty(0), rate, faster, self._unit, gimbal)
        return *gimbal.motion(rate, faster), -gimbal.moment(torque)

    def _driven(self, moved: _Wrist, step: float) -> ArmData:
        """Convert changes of the wrist to changes of all data, in the arm's own frame."""
        d_h, d_h_dot, d_h_ddot, d_force = (
            (after - before) / step for after, before in zip(moved, self._wrist, strict=True)
        )
        d_v = times(self._R_ib, d_h_dot)
        d_v_dot = times(self._R_ib, d_h_ddot) - cross(self._turning[0], d_v)
        return _changes(_NONE[:, None], d_h, _NONE, _NONE, d_v, d_v_dot, _NONE, times(self._R_ib, d_force))

    def _turned(self, d_R: Array, moved: tuple[Array, Array, Array], step: float) -> ArmData:
        """Convert changes of the gimbal to changes of all data, in the arm's own frame."""
        d_omega, d_omega_dot, d_moment = (
            (after - before) / step for after, before in zip(moved, self._turning, strict=True)
        )
        d_R_ib, (_, h_dot, h_ddot, force) = np.swapaxes(d_R, -1, -2), self._wrist
        d_v = times(d_R_ib, h_dot)
        d_v_dot = times(d_R_ib, h_ddot) - cross(d_omega, self._v) - cross(self._turning[0], d_v)
        return _changes(d_R, _NONE, d_omega, d_omega_dot, d_v, d_v_dot, d_moment, times(d_R_ib, force))

    def _levelled(self, parts: list[ArmData]) -> ArmData:
        R_bi, h, *rest = (np.concatenate(of_all) for of_all in zip(*parts, strict=True))
        R_ba = self._unit.R_ba
        return ArmData(R_ba @ R_bi, h @ R_ba.T, *rest)


def _each(x: Array, step: float) -> Array:
    """Return copies with one component changed in each, shapes (n, 3) -> (3, n, 3)."""
    out = np.repeat(components(x)[:, None], 3, axis=1)
    out[range(3), range(3)] += step
    return out.transpose(1, 2, 0)


def _changes(
    R: Array, h: Array, omega: Array, omega_dot: Array, v: Array, v_dot: Array, moment: Array, force: Array
) -> ArmData:
    """Assemble the changes; unchanged parts broadcast."""
    shape = force.shape
    h, *rest = (np.broadcast_to(part, shape) for part in (h, omega, v, omega_dot, v_dot, moment, force))
    twist, twist_dot, wrench = (np.concatenate(rest[k : k + 2], axis=-1) for k in (0, 2, 4))
    return ArmData(np.broadcast_to(R, (*shape, 3)), h, twist, twist_dot, wrench)
