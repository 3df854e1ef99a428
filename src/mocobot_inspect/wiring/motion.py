"""Motion and force of one robot's grasp from its channels, however wrong these may be."""

from dataclasses import dataclass

import numpy as np

from estimator.arm.delta import (
    LegGeometry,
    inverse_kinematics,
    is_in_reach,
    is_reachable,
    leg_geometry,
    wrist_motion,
)
from estimator.arm.design import OmnidDesign
from estimator.arm.dynamics import arm_torque
from estimator.arm.gimbal import angular_motion, rotation
from estimator.arm.wrist_level import driven_motion
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
        h_dot, h_ddot: velocity and acceleration of the wrist in {b} [m/s, m/s^2], shape (Q, 3).
        own_torque: spring torques that move the arm itself [N m], shape (Q, 3).
        faults: why the positions cannot be right.
    """

    legs: LegGeometry
    h_dot: Array
    h_ddot: Array
    own_torque: Array
    faults: tuple[Fault, ...]


@dataclass(frozen=True, eq=False)
class Gimbal:
    """What follows from one robot's gimbal angles alone.

    Attributes:
        R_bi: orientation of {i} in {b}, shape (Q, 3, 3).
        omega, alpha: its angular velocity [rad/s] and acceleration [rad/s^2] in {i}, shape (Q, 3).
        faults: why the angles cannot be right.
    """

    R_bi: Array
    omega: Array
    alpha: Array
    faults: tuple[Fault, ...]


class Motions:
    """Arms and gimbals of one log: many mistakes leave a robot the same numbers, and these are worked through once."""

    def __init__(self, design: OmnidDesign) -> None:
        """Nothing is known yet."""
        self._design = design
        self._arms: dict[tuple[str, int, bytes], Arm | Fault] = {}
        self._gimbals: dict[tuple[int, bytes], Gimbal] = {}

    def arm(self, signals: Signals, robot: int) -> Arm | Fault:
        """What ``arm_motion`` says."""
        key = signals.level, robot, signals.position.values[:, :, robot].tobytes()
        if key not in self._arms:
            self._arms[key] = arm_motion(signals, robot, self._design)
        return self._arms[key]

    def gimbal(self, signals: Signals, robot: int) -> Gimbal:
        """What ``gimbal_motion`` says."""
        key = robot, signals.theta.values[:, :, robot].tobytes()
        if key not in self._gimbals:
            self._gimbals[key] = gimbal_motion(signals, robot, self._design)
        return self._gimbals[key]


def arm_motion(signals: Signals, robot: int, design: OmnidDesign) -> Arm | Fault:
    """The arm of one robot (from 0), or why it cannot be in such postures."""
    position, wrist = signals.position.values[:, :, robot], signals.level == "wrist"
    faults: tuple[Fault, ...] = ()
    if not wrist:
        faults = _out_of_range("phi", position[0], design.phi_min_rad, design.phi_max_rad, "rad", robot)
    posture = _posture(position, design, wrist=wrist)
    if posture is None:
        what = "no driven angles reach its wrist positions" if wrist else "its rods cannot meet"
        return Fault(1.0 + sum(fault.share for fault in faults), f"omnid{robot + 1}: {what}")
    phi, position, legs = posture
    folded = float(np.mean(np.any(legs.leverage <= 0.0, axis=-1)))
    if folded > WRONG_SHARE:
        faults = (*faults, Fault(folded, f"omnid{robot + 1}: a leg is past its stretched position"))
    h_dot, h_ddot = (position[1], position[2]) if wrist else wrist_motion(legs, phi[1], phi[2])
    return Arm(legs, h_dot, h_ddot, arm_torque(phi[0], phi[1], phi[2], design, legs), faults)


def gimbal_motion(signals: Signals, robot: int, design: OmnidDesign) -> Gimbal:
    """The gimbal of one robot (from 0)."""
    theta = signals.theta.values[:, :, robot]
    limit = design.gimbal_limit_rad
    omega, alpha = angular_motion(theta[0], theta[1], theta[2])
    faults = _out_of_range("theta", theta[0], -limit, limit, "rad", robot)
    return Gimbal(rotation(theta[0]), omega, alpha, faults)


def grasp_motion(
    signals: Signals, robot: int, arm: Arm | Fault, gimbal: Gimbal, design: OmnidDesign
) -> tuple[Grasp | None, tuple[Fault, ...]]:
    """Motion and force at one grasp, None where the arm cannot be in such postures.

    Args:
        signals: the team's channels.
        robot: which robot, from 0.
        arm, gimbal: what follows from its positions and gimbal angles.
        design: the robots' numbers.

    Returns:
        The motion, and the faults of all channels.
    """
    if isinstance(arm, Fault):
        return None, (*gimbal.faults, arm)
    wrist, legs = signals.level == "wrist", arm.legs
    effort = signals.effort.values[0, :, robot]
    tau = legs.leverage * _solve(np.swapaxes(legs.rod, -1, -2), effort) if wrist else effort
    limit = TORQUE_FACTOR * design.torque_limit_Nm
    faults = _out_of_range("force" if wrist else "tau", tau, -limit, limit, "N m", robot)
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
        up=gimbal.R_bi[:, 2, :],
        force=_into(gimbal.R_bi, force),
        lift=force[:, 2],
        rise=arm.h_ddot[:, 2],
        noise=np.array(noise),
    )
    return grasp, (*arm.faults, *gimbal.faults, *faults)


def _posture(position: Array, design: OmnidDesign, *, wrist: bool) -> tuple[Array, Array, LegGeometry] | None:
    """Driven angles with rates and accelerations, and the positions themselves, both (3, Q, 3) and without the few
    instants that no arm can be in; and the geometry at the angles."""
    if not wrist:
        try:
            return position, position, leg_geometry(position[0], design)
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
        return position, position, leg_geometry(position[0], design)
    angles = inverse_kinematics(position[0], design)
    legs = leg_geometry(angles, design)
    return np.stack([angles, *driven_motion(legs, position[1], position[2])]), position, legs


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
