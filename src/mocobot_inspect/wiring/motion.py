"""Motion and force of one robot's grasp from its channels, however wrong these may be."""

from dataclasses import dataclass

import numpy as np

from estimator.arm.delta import (
    LegGeometry,
    driven_motion,
    inverse_kinematics,
    is_in_reach,
    is_reachable,
    leg_geometry,
    wrist_motion,
)
from estimator.arm.design import OmnidDesign
from estimator.arm.dynamics import angular_motion, arm_torque, rotation
from estimator.arm.unit import Arms, ArmUnit, arm_of, design_of
from estimator.arrays import Array
from estimator.errors import InputError
from estimator.recording.checks import TORQUE_FACTOR
from estimator.statistics import rms
from mocobot_inspect.signals import Signals, noise_gains

WRONG_SHARE = 0.01
"""A range that more than this share of the samples leaves is a fault of the wiring, not of some samples."""
_POSTURE = 3.0  # relative change of forces per radian


@dataclass(frozen=True, eq=False)
class Grasp:
    """What one robot says of its grasp frame {i}.

    Attributes:
        omega, alpha: angular velocity [rad/s] and acceleration [rad/s^2] in {i}, shape (Q, 3).
        velocity, acceleration: of the origin of {i} [m/s, m/s^2], in {i}, shape (Q, 3).
        up: unit vector against gravity in {i}, shape (Q, 3).
        force: on the payload in {i} [N], shape (Q, 3); the moment that moves the gimbal's own bodies, some mN m, is
            left out.
        lift: vertical force on the payload [N], shape (Q,).
        rise: vertical acceleration of the wrist [m/s^2], shape (Q,).
        noise: of one component of omega [rad/s], velocity [m/s], force [N] and up [rad].
    """

    omega: Array
    alpha: Array
    velocity: Array
    acceleration: Array
    up: Array
    force: Array
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


@dataclass(frozen=True, eq=False)
class Arm:
    """What follows from one robot's positions alone.

    Attributes:
        legs: geometry at the driven angles.
        told: the same by the design at the angles as read, which is how wrist positions and forces are told.
        h_dot, h_ddot: velocity and acceleration of the wrist in the arm's own frame [m/s, m/s^2], shape (Q, 3).
        own_torque: spring torques that move the arm itself [N m], shape (Q, 3).
        faults: why the positions cannot be right.
    """

    legs: LegGeometry
    told: LegGeometry
    h_dot: Array
    h_ddot: Array
    own_torque: Array
    faults: tuple[Fault, ...]


@dataclass(frozen=True, eq=False)
class Gimbal:
    """What follows from one robot's gimbal angles alone.

    Attributes:
        R_bi: orientation of {i} in the arm's own frame, shape (Q, 3, 3).
        omega, alpha: its angular velocity [rad/s] and acceleration [rad/s^2] in {i}, shape (Q, 3).
        faults: why the angles cannot be right.
    """

    R_bi: Array
    omega: Array
    alpha: Array
    faults: tuple[Fault, ...]


class Motions:
    """Arms and gimbals of one log: many mistakes leave a robot the same numbers, and these are worked through once."""

    def __init__(self, arms: Arms) -> None:
        """Nothing is known yet."""
        self._robots = arms
        self._arms: dict[tuple[str, int, bytes], Arm | Fault] = {}
        self._gimbals: dict[tuple[int, bytes], Gimbal] = {}

    def arm(self, signals: Signals, robot: int) -> Arm | Fault:
        """What ``arm_motion`` says."""
        key = signals.level, robot, signals.position.values[:, :, robot].tobytes()
        if key not in self._arms:
            self._arms[key] = arm_motion(signals, robot, self._robots)
        return self._arms[key]

    def gimbal(self, signals: Signals, robot: int) -> Gimbal:
        """What ``gimbal_motion`` says."""
        key = robot, signals.theta.values[:, :, robot].tobytes()
        if key not in self._gimbals:
            self._gimbals[key] = gimbal_motion(signals, robot, self._robots)
        return self._gimbals[key]


def arm_motion(signals: Signals, robot: int, arms: Arms) -> Arm | Fault:
    """The arm of one robot (from 0), or why it cannot be in such postures."""
    design, arm = design_of(arms), arm_of(arms, robot)
    position, wrist = signals.position.values[:, :, robot], signals.level == "wrist"
    faults: tuple[Fault, ...] = ()
    if not wrist:
        faults = _out_of_range("phi", position[0], design.phi_min_rad, design.phi_max_rad, "rad", robot)
    posture = _posture(position, design, wrist=wrist)
    if posture is not None and isinstance(arm, ArmUnit):
        posture = _corrected(posture, arm)
    if posture is None:
        what = "no driven angles reach its wrist positions" if wrist else "its rods cannot meet"
        return Fault(1.0 + sum(fault.share for fault in faults), f"omnid{robot + 1}: {what}")
    phi, motion, legs, told = posture
    folded = float(np.mean(np.any(legs.leverage <= 0.0, axis=-1)))
    if folded > WRONG_SHARE:
        faults = (*faults, Fault(folded, f"omnid{robot + 1}: a leg is past its stretched position"))
    h_dot, h_ddot = wrist_motion(legs, phi[1], phi[2]) if motion is None else motion
    return Arm(legs, told, h_dot, h_ddot, arm_torque(phi[0], phi[1], phi[2], arm, legs), faults)


def gimbal_motion(signals: Signals, robot: int, arms: Arms) -> Gimbal:
    """The gimbal of one robot (from 0)."""
    theta, arm = signals.theta.values[:, :, robot], arm_of(arms, robot)
    limit = design_of(arms).gimbal_limit_rad
    true = theta[0] - arm.of("theta_zero") if isinstance(arm, ArmUnit) else theta[0]
    omega, alpha = angular_motion(true, theta[1], theta[2])
    faults = _out_of_range("theta", theta[0], -limit, limit, "rad", robot)
    return Gimbal(rotation(true), omega, alpha, faults)


def grasp_motion(
    signals: Signals, robot: int, arm: Arm | Fault, gimbal: Gimbal, arms: Arms
) -> tuple[Grasp | None, tuple[Fault, ...]]:
    """Motion and force at one grasp, None where the arm cannot be in such postures.

    Args:
        signals: the team's channels.
        robot: which robot, from 0.
        arm, gimbal: what follows from its positions and gimbal angles.
        arms: the robots' numbers.

    Returns:
        The motion, and the faults of all channels.
    """
    if isinstance(arm, Fault):
        return None, (*gimbal.faults, arm)
    wrist, legs, told = signals.level == "wrist", arm.legs, arm.told
    design, unit = design_of(arms), arm_of(arms, robot)
    effort = signals.effort.values[0, :, robot]
    tau = told.leverage * _solve(np.swapaxes(told.rod, -1, -2), effort) if wrist else effort
    limit = TORQUE_FACTOR * design.torque_limit_Nm
    faults = _out_of_range("force" if wrist else "tau", tau, -limit, limit, "N m", robot)
    if isinstance(unit, ArmUnit):
        tau = unit.true_tau(tau)
    # Each leg pushes along its rod, see ``wrist_of``.
    force = np.sum(legs.rod * ((tau - arm.own_torque) / legs.leverage)[..., None], axis=-2)
    value, rate, _ = noise_gains()
    lever = 1.0 if wrist else design.proximal_length_m  # of driven rates and torques, in order of magnitude
    of_theta, of_position, of_effort = (
        rms(signals.group(kind).noise[robot]) for kind in ("theta", "position", "effort")
    )
    # A wrong posture turns and stretches forces, too: by as much as it is off, in order of magnitude.
    off = value * (of_position / design.proximal_length_m if wrist else of_position)
    noise = [
        rate * of_theta,
        rate * lever * of_position,
        float(np.hypot(value * of_effort / lever, _POSTURE * off * rms(force))),
        value * of_theta,
    ]
    grasp = Grasp(
        omega=gimbal.omega,
        alpha=gimbal.alpha,
        velocity=_into(gimbal.R_bi, arm.h_dot),
        acceleration=_into(gimbal.R_bi, arm.h_ddot),
        up=unit.up @ gimbal.R_bi,
        force=_into(gimbal.R_bi, force),
        lift=force @ unit.up,
        rise=arm.h_ddot @ unit.up,
        noise=np.array(noise),
    )
    return grasp, (*arm.faults, *gimbal.faults, *faults)


Posture = tuple[Array, tuple[Array, Array] | None, LegGeometry, LegGeometry]
"""Driven angles with rates and accelerations, (3, Q, 3); velocity and acceleration of the wrist, where they are told
and not worked out; the geometry at the angles, and by the design at the angles as read."""


def _posture(position: Array, design: OmnidDesign, *, wrist: bool) -> Posture | None:
    """What a robot as designed does, without the few instants that no arm can be in."""
    if not wrist:
        try:
            legs = leg_geometry(position[0], design)
            return position, None, legs, legs
        except InputError:  # some instants are impossible
            possible = is_reachable(position[0], design)
    else:
        possible = np.all(is_in_reach(position[0], design), axis=-1)
        possible[possible] = is_reachable(inverse_kinematics(position[0][possible], design), design)
    if np.mean(~possible) > WRONG_SHARE:
        return None
    if not possible.all():
        good = np.flatnonzero(possible)
        nearest = good[np.clip(np.searchsorted(good, np.arange(len(possible))), 0, len(good) - 1)]
        position = position[:, nearest]
    if not wrist:
        legs = leg_geometry(position[0], design)
        return position, None, legs, legs
    angles = inverse_kinematics(position[0], design)
    legs = leg_geometry(angles, design)
    phi = np.stack([angles, *driven_motion(legs, position[1], position[2])])
    return phi, (position[1], position[2]), legs, legs


def _corrected(posture: Posture, unit: ArmUnit) -> Posture | None:
    """The same of a robot as it is; None where it cannot be in such postures."""
    phi, _, _, told = posture
    phi = np.stack([phi[0] - unit.of("phi_zero"), phi[1], phi[2]])
    try:
        return phi, None, leg_geometry(phi[0], unit), told
    except InputError:
        return None


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


def _solve(matrix: Array, right: Array) -> Array:
    return np.asarray(np.linalg.solve(matrix, right[..., None])[..., 0], dtype=np.float64)


def _into(R_bi: Array, vector: Array) -> Array:
    return np.einsum("qji,qj->qi", R_bi, vector)
