"""Compute motion and force of the robots' grasps from possibly wrong channels, and fit one rigid body to them."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

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
from estimator.estimate.uncertainty import FACTOR, cross_information
from estimator.recording.checks import TORQUE_FACTOR
from estimator.rigid_team import newton_euler_regressor
from estimator.so3 import chordal_mean, cross
from estimator.statistics import rms
from mocobot_inspect.signals import Signals, noise_gains

WRONG_SHARE = 0.01
"""Share of samples outside a range above which the wiring is at fault rather than single samples."""
FARTHEST_M = 5.0
"""Largest plausible distance between grasps; a larger one means a wrong unit of lengths or angles."""
_POSTURE = 3.0  # relative change of forces per radian
_RANK = 1e-6


@dataclass(frozen=True)
class Fault:
    """Why a robot's channels cannot be what the map says."""

    share: float  # share of the instants that show it
    reason: str  # the reason in words


@dataclass(frozen=True, eq=False)
class Arm:
    """Quantities that follow from one robot's positions alone."""

    legs: LegGeometry  # geometry at the driven angles
    # geometry of the design at the angles as read; logged wrist positions and forces refer to it
    told: LegGeometry
    # h_dot, h_ddot: velocity and acceleration of the wrist in the arm's own frame [m/s, m/s^2], shape (Q, 3)
    h_dot: Array
    h_ddot: Array
    own_torque: Array  # spring torques that move the arm itself [N m], shape (Q, 3)
    faults: tuple[Fault, ...]  # why the positions cannot be right


@dataclass(frozen=True, eq=False)
class Gimbal:
    """Quantities that follow from one robot's gimbal angles alone."""

    R_bi: Array  # orientation of {i} in the arm's own frame, shape (Q, 3, 3)
    # omega, alpha: its angular velocity [rad/s] and acceleration [rad/s^2] in {i}, shape (Q, 3)
    omega: Array
    alpha: Array
    faults: tuple[Fault, ...]  # why the angles cannot be right


@dataclass(frozen=True, eq=False)
class Grasp:
    """Motion and force of one robot's grasp frame {i}."""

    # omega, alpha: angular velocity [rad/s] and acceleration [rad/s^2] in {i}, shape (Q, 3)
    omega: Array
    alpha: Array
    # velocity, acceleration: of the origin of {i} [m/s, m/s^2], in {i}, shape (Q, 3)
    velocity: Array
    acceleration: Array
    up: Array  # unit vector against gravity in {i}, shape (Q, 3)
    # on the payload in {i} [N], shape (Q, 3). The moment that moves the gimbal's own bodies, some mN m, is neglected.
    force: Array
    lift: Array  # vertical force on the payload [N], shape (Q,)
    rise: Array  # vertical acceleration of the wrist [m/s^2], shape (Q,)
    # noise of one component of omega [rad/s], velocity [m/s], force [N] and up [rad], shape (4,)
    noise: Array


def arm_motion(signals: Signals, robot: int, arms: Arms) -> Arm | Fault:
    """Return the motion of one arm (from 0), or the fault if its postures are impossible."""
    design, arm = design_of(arms), arm_of(arms, robot)
    position, wrist = signals.position.values[:, :, robot], signals.level == "wrist"
    faults: tuple[Fault, ...] = ()
    if not wrist:
        faults = _out_of_range("phi", position[0], design.phi_min_rad, design.phi_max_rad, "rad", robot)
    impossible = Fault(
        1.0 + sum(fault.share for fault in faults),
        f"omnid{robot + 1}: {'no driven angles reach its wrist positions' if wrist else 'its rods cannot meet'}",
    )
    try:
        angles, told = _driven(position, design, wrist=wrist)
    except InputError:  # at some instants
        possible = _possible(position, design, wrist=wrist)
        if possible is None:
            return impossible
        position = possible
        angles, told = _driven(position, design, wrist=wrist)
    phi, legs = position, told
    if wrist:
        phi = np.stack([angles, *driven_motion(told, position[1], position[2])])
    if isinstance(arm, ArmUnit):
        phi = np.stack([phi[0] - arm.of("phi_zero"), phi[1], phi[2]])
        try:
            legs = leg_geometry(phi[0], arm)
        except InputError:
            return impossible
    given = wrist and not isinstance(arm, ArmUnit)
    h_dot, h_ddot = position[1:] if given else wrist_motion(legs, phi[1], phi[2])
    folded = float(np.mean(np.any(legs.leverage <= 0.0, axis=-1)))
    if folded > WRONG_SHARE:
        faults = (*faults, Fault(folded, f"omnid{robot + 1}: a leg is past its stretched position"))
    return Arm(legs, told, h_dot, h_ddot, arm_torque(phi[0], phi[1], phi[2], arm, legs), faults)


def _driven(position: Array, design: OmnidDesign, *, wrist: bool) -> tuple[Array, LegGeometry]:
    """Return driven angles and geometry of the robot as designed; InputError if a posture is impossible."""
    angles = inverse_kinematics(position[0], design) if wrist else position[0]
    return angles, leg_geometry(angles, design)


def _possible(position: Array, design: OmnidDesign, *, wrist: bool) -> Array | None:
    """Replace the few impossible instants of positions by their neighbours; return None if there are too many.

    Positions are driven angles or wrist positions with rates and accelerations, shape (3, Q, 3).
    """
    if wrist:
        possible = np.all(is_in_reach(position[0], design), axis=-1)
        possible[possible] = is_reachable(inverse_kinematics(position[0][possible], design), design)
    else:
        possible = is_reachable(position[0], design)
    if np.mean(~possible) > WRONG_SHARE:
        return None
    good = np.flatnonzero(possible)
    return position[:, good[np.clip(np.searchsorted(good, np.arange(len(possible))), 0, len(good) - 1)]]


def gimbal_motion(signals: Signals, robot: int, arms: Arms) -> Gimbal:
    """Return the motion of one robot's gimbal (from 0)."""
    theta, arm = signals.theta.values[:, :, robot], arm_of(arms, robot)
    limit = design_of(arms).gimbal_limit_rad
    true = theta[0] - arm.of("theta_zero") if isinstance(arm, ArmUnit) else theta[0]
    omega, alpha = angular_motion(true, theta[1], theta[2])
    faults = _out_of_range("theta", theta[0], -limit, limit, "rad", robot)
    return Gimbal(rotation(true), omega, alpha, faults)


def grasp_motion(
    signals: Signals, robot: int, arm: Arm | Fault, gimbal: Gimbal, arms: Arms
) -> tuple[Grasp | None, tuple[Fault, ...]]:
    """Return motion and force of one grasp (robots count from 0), and the faults of all channels.

    There is no grasp if the arm's postures are impossible.
    """
    if isinstance(arm, Fault):
        return None, (*gimbal.faults, arm)
    wrist, legs, told = signals.level == "wrist", arm.legs, arm.told
    design, unit = design_of(arms), arm_of(arms, robot)
    tau = signals.effort.values[0, :, robot]
    if wrist:
        tau = told.leverage * np.linalg.solve(np.swapaxes(told.rod, -1, -2), tau[..., None])[..., 0]
    limit = TORQUE_FACTOR * design.torque_limit_Nm
    faults = _out_of_range("force" if wrist else "tau", tau, -limit, limit, "N m", robot)
    if isinstance(unit, ArmUnit):
        tau = unit.true_tau(tau)
    # Each leg pushes along its rod, see ``wrist_of``.
    force = np.sum(legs.rod * ((tau - arm.own_torque) / legs.leverage)[..., None], axis=-2)
    value, rate, _ = noise_gains()
    lever = 1.0 if wrist else design.proximal_length_m  # order of magnitude, for driven rates and torques
    of_theta, of_position, of_effort = (
        rms(group.noise[robot]) for group in (signals.theta, signals.position, signals.effort)
    )
    # An error of the posture also rotates and scales forces, by about its own size.
    off = value * (of_position / design.proximal_length_m if wrist else of_position)
    noise = [
        rate * of_theta,
        rate * lever * of_position,
        float(np.hypot(value * of_effort / lever, _POSTURE * off * rms(force))),
        value * of_theta,
    ]
    velocity, acceleration, force_i = (
        np.einsum("qji,qj->qi", gimbal.R_bi, x) for x in (arm.h_dot, arm.h_ddot, force)
    )
    grasp = Grasp(
        omega=gimbal.omega,
        alpha=gimbal.alpha,
        velocity=velocity,
        acceleration=acceleration,
        up=unit.up @ gimbal.R_bi,
        force=force_i,
        lift=force @ unit.up,
        rise=arm.h_ddot @ unit.up,
        noise=np.array(noise),
    )
    return grasp, (*arm.faults, *gimbal.faults, *faults)


def _out_of_range(
    name: str, values: Array, low: float, high: float, unit: str, robot: int
) -> tuple[Fault, ...]:
    share = float(np.mean(np.any((values < low) | (values > high), axis=-1)))
    if share <= WRONG_SHARE:
        return ()
    worst = float(values.flat[np.argmax(np.abs(values))])
    what = "torques that follow from force reach" if name == "force" else f"{name} reaches"
    reason = f"omnid{robot + 1}: {what} {worst:.4g} {unit}, outside {low:.4g} to {high:.4g}"
    return (Fault(share, f"{reason} in {100 * share:.0f} % of the time"),)


@dataclass(frozen=True, eq=False)
class Body:
    """Motion of the payload in {1}."""

    # R_1i, p_1i: grasp frames, shapes (N, 3, 3), (N, 3) [m]
    R_1i: Array
    p_1i: Array
    # omega, alpha: mean angular velocity [rad/s] and acceleration [rad/s^2], shape (Q, 3)
    omega: Array
    alpha: Array
    acceleration: Array  # mean acceleration of the origin of {1} [m/s^2], shape (Q, 3)
    up: Array  # mean direction against gravity, shape (Q, 3)
    noise: Array  # as in ``Grasp``, the largest of all robots
    turns: bool  # whether it rotates about two axes, clearly above the noise
    # disagreements of the robots, each with its signal and its noise; empty for one robot
    spread: dict[str, tuple[float, float, float]]
    gravity_mps2: float  # magnitude of gravity

    @property
    def span(self) -> float:
        """Largest distance of a grasp from the first one [m]."""
        return float(np.linalg.norm(self.p_1i, axis=1).max())

    @cached_property
    def regressor(self) -> Array:
        """Regressor of the total wrench in {1} for the ten inertial parameters, shape (Q, 6, 10)."""
        specific = self.acceleration + self.gravity_mps2 * self.up
        return newton_euler_regressor(self.omega, self.alpha, specific)


def rigid_body(told: Sequence[Grasp], gravity_mps2: float, most_noise: Array | None = None) -> Body | None:
    """Return the best-fitting rigid motion, or None without grasps or if the numbers overflow.

    Rotations solve Wahba's problem (paper, (3)-(5)), positions a linear least-squares problem (6)-(8), both against
    robot 1, whose frame is {1}. ``most_noise`` bounds the noise of ``Grasp``.
    """
    if not told or not all(np.isfinite(np.sum(g.force)) and np.isfinite(np.sum(g.omega)) for g in told):
        return None
    N, Q = len(told), len(told[0].omega)
    R = np.stack([np.eye(3), *(chordal_mean((told[0].omega.T @ g.omega)[None]) for g in told[1:])])
    omega, alpha, velocity, acceleration, up = (
        np.stack([getattr(g, name) @ R[k].T for k, g in enumerate(told)])
        for name in ("omega", "alpha", "velocity", "acceleration", "up")
    )
    p = np.zeros((N, 3))
    for j in range(1, N):
        p[j] = _position((omega[0] + omega[j]) / 2, velocity[j] - velocity[0])
    w, a = omega.mean(axis=0), alpha.mean(axis=0)
    noise = np.max([g.noise for g in told], axis=0)
    if most_noise is not None:
        noise = np.minimum(noise, most_noise)
    least = float(np.linalg.eigvalsh(cross_information(omega[0]))[0])
    spread: dict[str, tuple[float, float, float]] = {}
    if N > 1:
        count, span = Q * (N - 1), min(float(np.linalg.norm(p, axis=1).max()), FARTHEST_M)

        def apart(x: Array, components: int) -> float:
            return float(np.sqrt(np.sum((x - x.mean(axis=0)) ** 2) / (components * count)))

        at_first = velocity - cross(w, p[:, None])
        spread = {
            "rotation": (apart(omega, 3), rms(omega), float(noise[0])),
            "velocity": (apart(at_first, 3), rms(velocity), float(np.hypot(noise[1], noise[0] * span))),
            "tilt": (apart(up, 1), 1.0, 2.0 * float(noise[3])),
        }
    of_first = acceleration - cross(a, p[:, None]) - cross(w, cross(w, p[:, None]))
    return Body(
        R_1i=R,
        p_1i=p,
        omega=w,
        alpha=a,
        acceleration=of_first.mean(axis=0),
        up=up.mean(axis=0),
        noise=noise,
        turns=bool(np.sqrt(max(least, 0.0)) > FACTOR * noise[0]),
        spread=spread,
        gravity_mps2=gravity_mps2,
    )


def _position(w: Array, difference: Array) -> Array:
    """Return the p that best fits v_j - v_1 = w x p in {1}; the shortest one if it is not unique."""
    moment = np.mean(cross(difference, w), axis=0)
    return np.asarray(np.linalg.lstsq(cross_information(w), moment, rcond=_RANK)[0], dtype=np.float64)
