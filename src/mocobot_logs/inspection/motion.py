"""Motion and wrench of one robot's grasp from its channels, however wrong these may be."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimator.arm_dynamics import wrench_on_payload
from estimator.checks import TORQUE_FACTOR
from estimator.delta import inverse_kinematics, is_in_reach, is_reachable, leg_geometry, wrist_motion
from estimator.design import OmnidDesign
from estimator.gimbal import angular_motion, rotation
from estimator.wrist_level import driven_motion
from mocobot_logs.inspection.signals import Signals, noise_gains

Array = NDArray[np.float64]

WRONG_SHARE = 0.01
"""A range that more than this share of the samples leaves is a fault of the wiring, not of some samples."""


@dataclass(frozen=True, eq=False)
class Grasp:
    """What one robot says of its grasp frame {i}.

    Attributes:
        omega, alpha: angular velocity [rad/s] and acceleration [rad/s^2] in {i}, shape (Q, 3).
        velocity, acceleration: of the origin of {i} [m/s, m/s^2], in {i}, shape (Q, 3).
        up: unit vector against gravity in {i}, shape (Q, 3).
        wrench: on the payload, (m_i [N m], f_i [N]) in {i}, shape (Q, 6).
        lift: vertical force on the payload [N], shape (Q,).
        rise: vertical acceleration of the wrist [m/s^2], shape (Q,).
        noise: of one component of omega [rad/s], velocity [m/s], force [N] and up [rad].
    """

    omega: Array
    alpha: Array
    velocity: Array
    acceleration: Array
    up: Array
    wrench: Array
    lift: Array
    rise: Array
    noise: Array


@dataclass(frozen=True)
class Fault:
    """Why a robot's channels cannot be what they are taken for.

    Attributes:
        share: share of the instants that say so.
        reason: the same in words.
    """

    share: float
    reason: str


def grasp_motion(signals: Signals, robot: int, design: OmnidDesign) -> tuple[Grasp | None, tuple[Fault, ...]]:
    """Motion and wrench at one grasp, None where the arm cannot be in such a posture.

    Args:
        signals: the team's channels.
        robot: which robot, from 0.
        design: the robots' numbers.

    Returns:
        The motion, and the faults of its channels.
    """
    position, theta, effort = (
        signals.group(kind).values[:, :, robot] for kind in ("position", "theta", "effort")
    )
    noise = [signals.group(kind).noise[robot] for kind in ("position", "theta", "effort")]
    wrist = signals.level == "wrist"
    faults = _out_of_range("theta", theta[0], -design.gimbal_limit_rad, design.gimbal_limit_rad, "rad", robot)
    if not wrist:
        faults += _out_of_range("phi", position[0], design.phi_min_rad, design.phi_max_rad, "rad", robot)
    posture = _posture(position, design, wrist=wrist)
    if posture is None:
        what = "no driven angles reach its wrist positions" if wrist else "its rods cannot meet"
        return None, (*faults, Fault(1.0, f"omnid{robot + 1}: {what}"))
    phi, position, folded = posture
    if folded > WRONG_SHARE:
        faults = (*faults, Fault(folded, f"omnid{robot + 1}: a leg is past its stretched position"))
    legs = leg_geometry(phi[0], design)
    # What the springs put on the wrist is effort itself at wrist level; taking it to the joints and back is exact.
    tau = effort[0]
    if wrist:
        tau = legs.leverage * np.linalg.solve(np.swapaxes(legs.rod, -1, -2), tau[..., None])[..., 0]
    limit = TORQUE_FACTOR * design.torque_limit_Nm
    faults += _out_of_range("force" if wrist else "tau", tau, -limit, limit, "N m", robot)
    h_dot, h_ddot = (position[1], position[2]) if wrist else wrist_motion(legs, phi[1], phi[2])
    R_bi = rotation(theta[0])
    omega, alpha = angular_motion(theta[0], theta[1], theta[2])
    wrench = wrench_on_payload((phi[0], phi[1], phi[2]), (theta[0], theta[1], theta[2]), tau, design)
    value, rate, _ = noise_gains()
    lever = 1.0 if wrist else design.proximal_length_m  # of driven rates and torques, in order of magnitude
    scales = np.array([rate, rate * lever, value / lever, value])
    levels = np.array([_rms(noise[1]), _rms(noise[0]), _rms(noise[2]), _rms(noise[1])])
    return (
        Grasp(
            omega=omega,
            alpha=alpha,
            velocity=_into(R_bi, h_dot),
            acceleration=_into(R_bi, h_ddot),
            up=R_bi[:, 2, :],
            wrench=wrench,
            lift=np.einsum("qj,qj->q", R_bi[:, 2, :], wrench[:, 3:]),
            rise=h_ddot[:, 2],
            noise=scales * levels,
        ),
        faults,
    )


def _posture(position: Array, design: OmnidDesign, *, wrist: bool) -> tuple[Array, Array, float] | None:
    """Driven angles with rates and accelerations, the position itself, both without the few instants that no arm
    can be in, shape (3, Q, 3); and the share of postures past the stretched leg."""
    if wrist:
        possible = np.all(is_in_reach(position[0], design), axis=-1)
        possible[possible] = is_reachable(inverse_kinematics(position[0][possible], design), design)
    else:
        possible = is_reachable(position[0], design)
    if np.mean(~possible) > WRONG_SHARE:
        return None
    good = np.flatnonzero(possible)
    nearest = good[np.clip(np.searchsorted(good, np.arange(len(possible))), 0, len(good) - 1)]
    position = position[:, nearest]
    if wrist:
        angles = inverse_kinematics(position[0], design)
        legs = leg_geometry(angles, design)
        phi = np.stack([angles, *driven_motion(legs, position[1], position[2])])
    else:
        phi, legs = position, leg_geometry(position[0], design)
    return phi, position, float(np.mean(np.any(legs.leverage <= 0.0, axis=-1)))


def _out_of_range(
    name: str, values: Array, low: float, high: float, unit: str, robot: int
) -> tuple[Fault, ...]:
    outside = np.any((values < low) | (values > high), axis=-1)
    share = float(np.mean(outside))
    if share <= WRONG_SHARE:
        return ()
    worst = float(values.flat[np.argmax(np.abs(values))])
    what = "torques that follow from force reach" if name == "force" else f"{name} reaches"
    reason = f"omnid{robot + 1}: {what} {worst:.4g} {unit}, outside {low:.4g} to {high:.4g}"
    return (Fault(share, f"{reason} in {100 * share:.0f} % of the time"),)


def _into(R_bi: Array, vector: Array) -> Array:
    return np.einsum("qji,qj->qi", R_bi, vector)


def _rms(x: Array) -> float:
    return float(np.sqrt(np.mean(np.square(x))))
