"""Causes in the readings of a robot: zeros, scales, lags, late clocks, link lengths; and tilts of bases."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from discrepancy.team.causes.base import Cause, ReadingError, one_joint, one_robot, stack
from discrepancy.team.causes.friction import in_parts, pieces_while, played
from discrepancy.team.linear.rows import PATCH_COLUMNS
from estimator.arm.delta import LEG_DIRECTIONS, jacobian_of, leg_geometry
from estimator.arm.motion import PHI
from estimator.arm.unit import ArmUnit, design_of
from estimator.arrays import Array


class Late(ReadingError):
    """A robot's readings are late by ``delay_s``.

    Attributes:
        readings: names of the late readings.
    """

    parameters = ("delay_s",)
    at = "robot"
    readings = ("tau",)

    def errors(self, signals, robot, joint, shape, arm):
        rates = {x: signals.with_rates(getattr(signals, x)[:, robot])[1] for x in self.readings}
        return [{x: -rate for x, rate in rates.items()}]

    def undo(self, signals, trial, robot, joint, values, shape):
        time = np.arange(len(signals.time)) / signals.rate_hz
        at = np.clip(time + values[0], 0.0, time[-1])  # readings stay constant beyond the ends
        late = {}
        for name in self.readings:
            x = getattr(signals, name)[:, robot]
            shifted = CubicSpline(time, x)(at)
            # Beyond the end the last sample holds exactly; the spline meets it only up to rounding.
            shifted[at >= time[-1]] = x[-1]
            late[name] = one_robot(x - shifted, trial.robots, robot)
        return signals.minus(**late)


class PhiZero(ReadingError):
    """phi reads too high by a constant."""

    title = "encoder zero of {driven joint}"
    family = "arm_geometry"
    parameters = ("zero_rad",)
    tolerances = (1e-4,)
    separate = "Poses spread over the whole workspace separate a zero from a wrong length."

    def sentence(self, n):
        much = n.either("zero_rad", "too much", "too little")
        return f"the encoder of the driven joint reads {n('zero_rad', 'mrad', 1e3)} {much}"

    def errors(self, signals, robot, joint, shape, arm):
        return [{"phi": np.eye(3)[joint]}]


class ThetaZero(ReadingError):
    """theta reads too high by a constant; joints 1, 2, 3 are z, y, x."""

    title = "encoder zero of {gimbal axis}"
    family = "gimbal_zero"
    parameters = ("zero_rad",)
    tolerances = (1e-4,)
    at = "gimbal joint"
    joints = (1, 2)  # no recording can show that of the last axis
    separate = (
        "The zero of the last gimbal axis is part of the grasp frame; only a known grasp would show it."
    )

    def sentence(self, n):
        much = n.either("zero_rad", "too much", "too little")
        return f"the encoder of the gimbal joint reads {n('zero_rad', 'mrad', 1e3)} {much}"

    def errors(self, signals, robot, joint, shape, arm):
        return [{"theta": np.eye(3)[joint]}]


PLAY_STEP_RAD, CROSSING_S = 1e-4, 0.3
"""Change of a reading that is more than noise [rad], and longest time in which a joint crosses the play [s]. Chosen: a
step of a 16-bit encoder; commanded motion turns round by 5 mrad in a quarter of a second."""
STANDS_S, BESIDE_S, STANDING_KNOTS_S = 0.1, 0.05, 0.05
"""Time in which a joint may leave its side of the play and come back, time beside a stop of the reading, and between
knots of what it leaves open [s]. Chosen: the reading's last step comes up to 20 ms before the turn."""
STANDING_OPEN = 1.0 / np.sqrt(3.0)
"""Standard deviation of a joint's place while its reading stands still, over half the play. Derived: any place in the
play is as likely."""


class EncoderPlay(ReadingError):
    """A gimbal's encoder lags the joint by half the play, in the direction of motion (joints 1, 2, 3 are z, y, x)."""

    title = "play in the encoder of {gimbal axis}"
    family = "gimbal_zero"
    parameters = ("play_rad",)
    tolerances = (1e-5,)
    positive = ("play_rad",)
    clipped = ("play_rad",)
    at = "gimbal joint"
    separate = (
        "Slow motion to and fro of one gimbal axis shows how long its reading stands still after each turn."
    )

    def sentence(self, n):
        return f"the encoder of the gimbal joint has {n('play_rad', 'mrad', 1e3)} of play"

    def errors(self, signals, robot, joint, shape, arm):
        way, _ = _way_behind(signals.theta[:, robot, joint], signals.rate_hz)
        return [{"theta": one_joint(-0.5 * way, joint)}]

    def unknowns(self, trial, robot, joint, shape):
        """While the reading stands still, the joint may be anywhere in the play."""
        rate_hz = trial.signals.rate_hz
        _, stands = _way_behind(trial.signals.theta[:, robot, joint], rate_hz)
        pieces = in_parts(pieces_while(stands, rate_hz, STANDING_KNOTS_S), PATCH_COLUMNS)
        return trial.of_misreadings(robot, joint, ((at, 0.5 * STANDING_OPEN * x) for at, x in pieces))


def _way_behind(reading: Array, rate_hz: float) -> tuple[Array, NDArray[np.bool_]]:
    """Place of a joint in the play of its encoder by the readings, -1 to 1, and where that is open, shape (Q,) each.

    It is that of the last motion. After a turn the reading stands still while the joint crosses the play, with constant
    acceleration. Before the first motion the encoder is amid its play. A joint may turn twice
    while its reading stands still, so every longer stop of the reading is open.
    """
    sign = np.sign(np.diff(played(reading, PLAY_STEP_RAD), prepend=reading[0]))
    moves = np.flatnonzero(sign)
    way, open_, before = np.zeros(len(reading)), np.zeros(len(reading), dtype=bool), 0.0
    beside = round(BESIDE_S * rate_hz)
    ends = np.concatenate([[0], moves, [len(reading)]])
    turns = np.diff(sign[moves], prepend=0.0) != 0.0
    for k in np.flatnonzero((np.diff(ends) > STANDS_S * rate_hz) | np.append(turns, False)):
        open_[max(0, ends[k] - beside) : ends[k + 1] + beside] = True
    for k in np.flatnonzero(turns):
        now, after = moves[k], sign[moves[k]]
        start = max(0 if not k else moves[k - 1], now - round(CROSSING_S * rate_hz))
        way[start:now] = before + (after - before) * np.linspace(0.0, 1.0, now - start, endpoint=False) ** 2
        way[now:], before = after, after
    return way, open_


class SeaScale(ReadingError):
    """The spring is stiffer than assumed by a factor 1 + scale, so the torque reads too low.

    A scale common to all springs cannot be distinguished from the payload's mass; the scale of one spring can.
    """

    title = "spring stiffness of {driven joint}"
    family = "sea_torque"
    parameters = ("scale",)
    tolerances = (1e-3,)
    adjusted = True
    separate = "Loads of both signs on the joint (a known added weight) separate bias, scale and hardening."

    def sentence(self, n):
        stiffer, small = n.either("scale", "stiffer", "softer"), n.either("scale", "too small", "too large")
        return f"the spring is {n('scale', '%', 1e2)} {stiffer} than assumed, so the torque is read {small}"

    def errors(self, signals, robot, joint, shape, arm):
        return [{"tau": one_joint(-signals.tau[:, robot, joint] / _stiffness(arm, joint), joint)}]


class SeaBias(ReadingError):
    """tau reads too high by a constant."""

    title = "torque zero of {driven joint}"
    family = "sea_torque"
    parameters = ("bias_Nm",)
    tolerances = (3e-3,)
    separate = "Loads of both signs on the joint (a known added weight) separate bias, scale and hardening."

    def sentence(self, n):
        return (
            f"the torque sensor reads {n('bias_Nm', 'N m')} {n.either('bias_Nm', 'too much', 'too little')}"
        )

    def errors(self, signals, robot, joint, shape, arm):
        return [{"tau": _stiffness(arm, joint) * np.eye(3)[joint]}]


def _stiffness(arm, joint):
    """Stiffness of a spring over the stiffness that its readings assume."""
    return 1.0 + (arm.of("stiffness_ratio")[joint] if isinstance(arm, ArmUnit) else 0.0)


class SeaHardening(ReadingError):
    """A deflection d produces the torque k d + k3 d^3, but the sensor reads k d."""

    title = "hardening of the spring of {driven joint}"
    family = "sea_torque"
    parameters = ("cubic_Nm_per_rad3",)
    tolerances = (3.0,)
    adjusted = True
    separate = "Loads of both signs on the joint (a known added weight) separate bias, scale and hardening."

    def sentence(self, n):
        hardens = n.either("cubic_Nm_per_rad3", "hardens", "softens")
        return f"the spring {hardens} with its deflection, by {n('cubic_Nm_per_rad3', 'N m/rad^3')} (cubic)"

    def errors(self, signals, robot, joint, shape, arm):
        deflection = signals.tau[:, robot, joint] / design_of(arm).sea_stiffness_Nm_per_rad
        return [{"tau": one_joint(-(deflection**3), joint)}]


class TorqueSkew(Late):
    """All torques of a robot are logged late by ``delay_s``; the controller sees them in time."""

    title = "late torque log of {robot}"
    family = "dissipation"
    tolerances = (1e-4,)
    separate = "The commands separate a late log from a lag inside the sensor, which the controller sees too."

    def sentence(self, n):
        return f"the torques are logged {n('delay_s', 'ms', 1e3, signed=True)} later than the angles"


class TorqueLag(ReadingError):
    """All torques of a robot pass a first-order lag, which also affects the controller."""

    title = "lag of the torque sensors of {robot}"
    family = "dissipation"
    parameters = ("time_constant_s",)
    tolerances = (1e-4,)
    at = "robot"
    positive = ("time_constant_s",)
    separate = "The commands separate a lag inside the sensor from a late log."

    def sentence(self, n):
        return f"the torque sensor follows with a time constant of {n('time_constant_s', 'ms', 1e3, signed=True)}"

    def errors(self, signals, robot, joint, shape, arm):
        # truth = reading + T d(reading)/dt
        return [{"tau": -signals.with_rates(signals.tau[:, robot])[1]}]


class SensorLag(ReadingError):
    """The torque of one joint passes a first-order lag, which also affects the controller."""

    title = "lag of the torque sensor in {driven joint}"
    family = "dissipation"
    parameters = ("time_constant_s",)
    tolerances = (1e-4,)
    positive = ("time_constant_s",)
    separate = "The commands separate a lag inside the sensor from a late log."

    def sentence(self, n):
        return f"the torque sensor follows with a time constant of {n('time_constant_s', 'ms', 1e3, signed=True)}"

    def errors(self, signals, robot, joint, shape, arm):
        # truth = reading + T d(reading)/dt
        return [{"tau": -one_joint(signals.with_rates(signals.tau[:, robot, joint])[1], joint)}]


class ClockDelay(Late):
    """All readings of a robot are late by ``delay_s``.

    An equal delay of all robots is unobservable, because the model uses the same late readings. Each column is
    therefore the effect of one robot's delay minus the mean over all robots.
    """

    title = "clock delay of {robot}"
    family = "clock"
    tolerances = (1e-5,)
    readings = ("phi", "theta", "tau")
    by_clocks = True
    separate = "Fast motion of all robots at once."

    def sentence(self, n):
        return f"all that it logs is {n('delay_s', 'ms', 1e3)} {n.either('delay_s', 'late', 'early')}"

    def columns(self, trial, robot, joint, shape):
        each = [super(ClockDelay, self).columns(trial, i, joint, shape) for i in range(trial.robots)]
        return each[robot] - np.mean(each, axis=0)


class LinkLength(ReadingError):
    """Lengths of a leg deviate from the design.

    At the same wrist position the joint then has another angle. A length error thus acts as a pose-dependent error of
    phi and, by virtual power, of the torques. The weight of link and knee follows the true angle.
    """

    title = "lengths of {leg}"
    family = "arm_geometry"
    adjusted = True
    parameters = ("proximal_m", "rod_m", "base_radius_m")
    tolerances = (2e-5, 2e-5, 2e-5)
    separate = "Poses spread over the whole workspace separate a wrong length from an encoder's zero."

    def sentence(self, n):
        parts = zip(
            self.parameters, ("the driven link is", "the rods are", "the base radius is"), strict=True
        )
        words = [
            f"{what} {n(name, 'mm', 1e3)} {n.either(name, 'too long', 'too short')}"
            for name, what in parts
            if n.values.get(name)
        ]
        return "the leg deviates from its design: " + (", ".join(words) or "by nothing that shows")

    def errors(self, signals, robot, joint, shape, arm):
        angle, torque = _errors(signals.phi[:, robot], signals.tau[:, robot], joint, arm)
        return [{"phi": one_joint(a, joint), "tau": t} for a, t in zip(angle, torque, strict=True)]


def _errors(phi, tau, joint, arm):
    """Readings minus those of a leg with the assumed lengths, per metre: angles (3, Q) and torques (3, Q, 3)."""
    angle, slopes = _phi_error(phi, joint, arm)
    at, leg = phi[:, joint], partial(_of_leg, joint=joint)
    at_knee = 0.5 * arm.gravity_mps2 * leg(arm.rod_mass_kg)
    weight = arm.gravity_mps2 * leg(arm.proximal_mass_kg) * arm.proximal_com_m + at_knee * leg(
        arm.proximal_length_m
    )
    # (I - d(error)/d(phi))^-T on the torque that drives the wrist, to first order ...
    torque = -slopes * (tau[:, joint] - weight * np.cos(at))[:, None]
    # ... and the weight of link and knee at another angle, and of the knee on a longer lever.
    torque[:, :, joint] -= weight * np.sin(at) * angle
    torque[0, :, joint] += at_knee * np.cos(at)
    return angle, torque


def _of_leg(values, joint):
    """Value of one leg; the legs of the design are equal."""
    return np.broadcast_to(values, 3)[joint]


def _phi_error(phi, joint, arm):
    """Error of phi due to length errors of a leg, per metre, and its derivative by the three angles.

    The error is the reading minus the angle at which a leg with the assumed lengths reaches the same wrist. It equals
    minus the change of rod length due to a longer link, a longer rod or a wider base, over the rod's leverage.

    Returns:
        Error, shape (3, Q), and derivative, shape (3, Q, 3).
    """
    legs, own = leg_geometry(phi, arm), np.eye(3)[joint]
    rod, knee, lever = legs.rod[:, joint], legs.knee_d1[:, joint], legs.leverage[:, joint]
    u, up, angle = LEG_DIRECTIONS[joint], np.eye(3)[2], phi[:, joint]
    along = np.cos(angle)[:, None] * u + np.sin(angle)[:, None] * up
    across = np.cos(angle)[:, None] * up - np.sin(angle)[:, None] * u
    length = np.full(len(phi), _of_leg(arm.rod_length_m, joint))
    shares = np.stack([np.sum(rod * along, axis=1), length, rod @ u])
    # Every angle moves the wrist; the leg's own angle moves the knee.
    rod_moves = jacobian_of(legs) - knee[..., None] * own  # (Q, 3, 3)
    of_along = np.einsum("qij,qi->qj", rod_moves, along) + np.sum(rod * across, axis=1)[:, None] * own
    of_lever = (
        np.einsum("qij,qi->qj", rod_moves, knee) + np.sum(rod * legs.knee_d2[:, joint], axis=1)[:, None] * own
    )
    of_shares = np.stack([of_along, np.zeros_like(of_along), np.einsum("qij,i->qj", rod_moves, u)])
    error = -shares / lever
    return error, -(of_shares + error[..., None] * of_lever) / lever[:, None]


class BaseTilt(Cause):
    """{b} is turned by the rotation vector (roll, pitch, 0) in {b}; yaw is a nuisance parameter of each trial."""

    title = "tilt of {base}"
    family = "base_tilt"
    parameters = ("roll_rad", "pitch_rad")
    tolerances = (1e-4, 1e-4)
    at = "robot"
    separate = "Larger tilts of the payload, and holds."

    def sentence(self, n):
        return (
            f"the base does not stand level: turned by {n('roll_rad', 'mrad', 1e3, signed=True)} about its x axis and "
            f"{n('pitch_rad', 'mrad', 1e3, signed=True)} about its y axis"
        )

    def columns(self, trial, robot, joint, shape):
        return stack([self._column(trial, robot, np.eye(3)[k]) for k in range(2)])

    @staticmethod
    def _column(trial, robot, rho):
        grasps, bases, data, arm = trial.shared.grasps, trial.bases, trial.data, trial.arm(robot)
        samples = len(trial.s)
        raw = np.zeros((samples, trial.channels))
        turn = bases.R[robot] @ rho  # in {b1}
        for i in range(1, trial.robots):
            at = 6 * (i - 1)
            place = data.p_bi[:, i] @ bases.R[i].T
            if robot == 0:
                raw[:, at : at + 3] = turn
                raw[:, at + 3 : at + 6] = np.cross(turn, bases.p[i] + place)
            elif robot == i:
                raw[:, at : at + 3] = -turn
                raw[:, at + 3 : at + 6] = -np.cross(turn, place)
        up_b = -np.cross(rho, [0.0, 0.0, 1.0])  # change of the vertical in {b}
        g, mass, mass_c = data.gravity_mps2, trial.shared.pi[0], trial.shared.pi[1:4]
        up = np.einsum("qji,j->qi", data.R_bi[:, robot], up_b) @ grasps.R_1i[robot].T / trial.robots
        raw[:, -6:-3] = mass * g * up
        raw[:, -3:] = np.cross(mass_c, g * up)
        # The arm's own weight, which the balance subtracts from the torques.
        legs = leg_geometry(trial.s[:, robot, PHI], arm)
        at_knee = arm.proximal_mass_kg * arm.proximal_com_m / arm.proximal_length_m + 0.5 * arm.rod_mass_kg
        at_wrist = arm.wrist_mass_kg + 0.5 * np.sum(np.broadcast_to(arm.rod_mass_kg, 3))
        torque = g * (
            at_knee * (legs.knee_d1 @ up_b) + at_wrist * np.einsum("qij,i->qj", jacobian_of(legs), up_b)
        )
        return trial.reduction(raw) + trial.of_signals(robot, tau=torque)
