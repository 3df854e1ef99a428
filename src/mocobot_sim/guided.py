"""A person guides the payload by hand; the arms carry its weight and are otherwise soft."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from estimator.arm import dynamics as gimbal
from estimator.arrays import Array
from estimator.errors import InputError
from estimator.estimate.result import PayloadEstimate
from mocobot_sim.control.control import ControlGains
from mocobot_sim.scene.as_built import AsBuilt, units_of
from mocobot_sim.scene.models import omnid_design
from mocobot_sim.trial.actors import Stage
from mocobot_sim.trial.trajectories import minimum_jerk
from mocobot_sim.trial.truth import GroundTruth


@dataclass(frozen=True)
class Payload:
    """What is believed of a payload.

    Attributes:
        mass_kg: mass; 0 if its weight is not to be carried.
        p_1c: centre of mass in {1} [m], shape (3,).
        p_1i: grasps in {1} [m], shape (N, 3).
        R_1i: grasp orientations in {1}, shape (N, 3, 3).
    """

    mass_kg: float
    p_1c: Array
    p_1i: Array
    R_1i: Array

    @classmethod
    def of_estimate(cls, estimate: PayloadEstimate) -> Payload:
        """What an estimate says.

        Raises:
            InputError: it does not determine grasps, mass and centre of mass.
        """
        if estimate.grasps is None or estimate.mass is None or estimate.p_1c is None:
            known = {"grasps": estimate.grasps, "mass": estimate.mass, "centre of mass": estimate.p_1c}
            missing = ", ".join(name for name, value in known.items() if value is None)
            raise InputError(f"the estimate has no {missing}; carrying a payload's weight needs it")
        return cls(estimate.mass.mass, estimate.p_1c, estimate.grasps.p_1i, estimate.grasps.R_1i)

    @classmethod
    def of_truth(cls, truth: GroundTruth) -> Payload:
        """What is so."""
        return cls(truth.mass_kg, truth.p_1c, truth.p_1i, truth.R_1i)


def weight_shares(payload: Payload, up_1: ArrayLike, gravity_mps2: float) -> Array:
    """Upward forces at the grasps that carry the payload's weight without turning it [N], shape (N,).

    They add up to the weight, and their moment about the centre of mass is zero. With three grasps they are unique,
    with more the smallest are taken; with one or two a moment stays that cannot be balanced. ``up_1`` is the direction
    away from the ground in {1}, unit length, shape (3,).
    """
    up = np.asarray(up_1, dtype=float)
    arms = payload.p_1i - payload.p_1c
    # Forces along ``up`` balance only the moment across it: two directions.
    across = np.linalg.svd(up[None])[2][1:]
    scale = max(np.linalg.norm(arms, axis=1).max(), 1e-9)
    rows = np.vstack([np.ones(len(arms)), across @ np.cross(arms, up).T / scale])
    shares = np.linalg.lstsq(rows, np.array([payload.mass_kg * gravity_mps2, 0.0, 0.0]))[0]
    return np.asarray(shares, dtype=np.float64)


def up_in_payload(theta: Array, R_1i: Array) -> Array:
    """Up, in {1}, as a level robot sees it through its own gimbal, shape (..., 3).

    ``theta`` are its gimbal angles (z, y, x) [rad], shape (..., 3), ``R_1i`` its grasp's orientation, (..., 3, 3).
    """
    up_i = gimbal.rotation(theta)[..., 2, :]  # the third row of R_bi is z of {b} in {i}
    return (R_1i @ up_i[..., None])[..., 0]


# No stiffness. The SEA torque loop lags behind the changing lever arms, which takes about 1.4 N s/m of damping away
# per arm (measured with payload (a)); a little more than that brings a payload that nobody holds to rest.
FLOAT_GAINS = ControlGains(stiffness_N_per_m=0.0, damping_Ns_per_m=2.0)


class FloatArms:
    """Sets every arm's feed-forward force to its share of the weight, at the payload's present tilt.

    A trial starts at rest with the payload held. From ``start_s`` on, within ``fade_s``, the forces that hold it then
    give way to those that ``payload`` asks for; the gains do not change (``FLOAT_GAINS``, or softer arms' own).

    Args:
        payload: whose weight the robots believe they carry, or None for the forces that they start with, for ever.
        as_built: sensor zeros of every unit; empty for robots as designed.
        start_s, fade_s: when and how fast [s].
    """

    def __init__(
        self,
        payload: Payload | None,
        as_built: Sequence[AsBuilt] = (),
        start_s: float = 0.2,
        fade_s: float = 1.5,
    ) -> None:
        if not start_s > 0 or not fade_s > 0:
            raise InputError(f"start_s is {start_s} and fade_s {fade_s}; both must be greater than 0")
        self._payload, self._as_built = payload, as_built
        self._start_s, self._fade_s = start_s, fade_s

    def start(self, stage: Stage) -> None:
        """Get ready.

        Raises:
            InputError: the payload has another number of grasps than there are robots.
        """
        robots = stage.index.robots
        if self._payload is not None and len(self._payload.p_1i) != robots:
            raise InputError(
                f"the payload has {len(self._payload.p_1i)} grasps; the team has {robots} robots"
            )
        self._stage = stage
        self._theta_zero = np.array([unit.theta_zero_rad for unit in units_of(self._as_built, robots)])
        self._gravity = omnid_design().gravity_mps2
        self._held = np.zeros((robots, 3))

    def act(self, tick: int) -> None:
        """Every sample, set the forces; the payload turns slowly."""
        stage = self._stage
        if tick == 1:
            self._held = stage.controller.feed_forward  # measured by the arms in their first tick
            stage.controller.feed_forward = self._held
        if tick and tick % stage.ticks == 0 and self._payload is not None:
            share = minimum_jerk(np.array((tick / stage.rate_hz - self._start_s) / self._fade_s))
            stage.controller.feed_forward = (1.0 - share) * self._held + share * self.forces()

    def forces(self) -> Array:
        """What the payload asks for now: force of every wrist in its {b} [N], shape (N, 3)."""
        payload, force = self._payload, np.zeros_like(self._held)
        if payload is not None and payload.mass_kg > 0:
            theta = self._stage.data.qpos[self._stage.index.gimbal_qpos] + self._theta_zero
            for i, up in enumerate(up_in_payload(theta, payload.R_1i)):
                # Every robot sees the tilt by its own gimbal, and takes its own share.
                force[i, 2] = weight_shares(payload, up, self._gravity)[i]
        return force


@dataclass(frozen=True)
class Grip:
    """Two hands that hold a payload firmly: stiffness and damping, isotropic.

    Attributes:
        stiffness_N_per_m, damping_Ns_per_m: of the position.
        stiffness_Nm_per_rad, damping_Nms_per_rad: of the orientation.
    """

    stiffness_N_per_m: float = 1000.0
    damping_Ns_per_m: float = 100.0
    stiffness_Nm_per_rad: float = 100.0
    damping_Nms_per_rad: float = 10.0


@dataclass(frozen=True)
class Move:
    """One piece of a hand's path, with minimum jerk from rest to rest.

    Attributes:
        by_m: displacement from where the hand began, at its end, in the world [m], shape (3,).
        turn_rad: rotation vector from how it began, at its end, in the world [rad], shape (3,).
        duration_s: time to get there, greater than 0 [s].
        rest_s: time at rest there [s].
    """

    by_m: tuple[float, float, float]
    turn_rad: tuple[float, float, float]
    duration_s: float
    rest_s: float = 0.0


@dataclass(frozen=True)
class HandLog:
    """What a hand did, one row per sample; in the axes of the world.

    Attributes:
        time: [s], shape (Q,).
        force: on the payload [N], shape (Q, 3).
        moment: on the payload about the grip [N m], shape (Q, 3).
        intended: position of the grip that the person wants [m], shape (Q, 3).
        position: where it is [m], shape (Q, 3).
        tilt: rotation vector from the wanted orientation to the present one [rad], shape (Q, 3).
        power: of the hand, into the payload [W], shape (Q,).
    """

    time: Array
    force: Array
    moment: Array
    intended: Array
    position: Array
    tilt: Array
    power: Array


class _OnPayload:
    """A wrench on the payload at a point of it."""

    def __init__(self, point_1: ArrayLike) -> None:
        self._point_1 = np.asarray(point_1, dtype=float)
        if self._point_1.shape != (3,) or not np.isfinite(self._point_1).all():
            raise InputError(
                f"the point on the payload is {self._point_1.tolist()}; it must be three finite numbers"
            )

    def start(self, stage: Stage) -> None:
        """Get ready.

        Raises:
            InputError: the robots hold nothing.
        """
        if stage.index.payload_body < 0:
            raise InputError("the robots hold nothing; a hand needs a payload")
        self._stage, self._body = stage, stage.index.payload_body
        self._rows: list[tuple[Array, ...]] = []
        self._velocity = np.zeros(6)

    def _at(self) -> tuple[Array, Array, Array, Array]:
        """Position, orientation, velocity and angular velocity of the point, in the world, one time step ago."""
        model, data = self._stage.model, self._stage.data
        R = data.xmat[self._body].reshape(3, 3).copy()
        arm = R @ self._point_1
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, self._body, self._velocity, 0)
        turning = self._velocity[:3].copy()
        moving = self._velocity[3:] + _cross(turning, arm)
        return data.xpos[self._body] + arm, R, moving, turning

    def _press(self, force: Array, moment: Array, at: Array) -> None:
        applied = self._stage.data.xfrc_applied[self._body]
        applied[:3] += force
        applied[3:] += moment + _cross(at - self._stage.data.xipos[self._body], force)

    def log(self) -> HandLog:
        """What has happened."""
        columns = [np.array(column) for column in zip(*self._rows, strict=True)]
        return HandLog(np.arange(len(self._rows)) * self._stage.ticks / self._stage.rate_hz, *columns)


class GuidingHand(_OnPayload):
    """A spring-damper between the payload and a grip that moves as the person wants: an actor of a trial.

    Args:
        point_1: where it holds the payload, in {1} [m], shape (3,).
        moves: the path of the grip, relative to where the trial starts.
        start_s: when it begins to move [s].
        grip: how firmly it holds.
    """

    def __init__(
        self, point_1: ArrayLike, moves: Sequence[Move], start_s: float, grip: Grip | None = None
    ) -> None:
        super().__init__(point_1)
        if not moves or not all(move.duration_s > 0 and move.rest_s >= 0 for move in moves):
            raise InputError("a hand needs moves that last longer than 0 s, with rests of 0 s or more")
        self._moves, self._start_s, self._grip = tuple(moves), start_s, grip or Grip()

    @property
    def duration_s(self) -> float:
        """From the start of the trial to the end of the last rest [s]."""
        return self._start_s + sum(move.duration_s + move.rest_s for move in self._moves)

    def start(self, stage: Stage) -> None:
        """Take hold."""
        super().start(stage)
        position, R, _, _ = self._at()
        by, turn = hand_path(self._moves, self._start_s, stage.duration, stage.rate_hz)
        turns = Rotation.from_rotvec(turn)
        self._position, self._velocity_of = position + by, np.gradient(by, 1.0 / stage.rate_hz, axis=0)
        self._R = (turns * Rotation.from_matrix(R)).as_matrix()
        step = (turns[1:] * turns[:-1].inv()).as_rotvec() * stage.rate_hz
        self._turning = np.vstack([step, step[-1:]])

    def act(self, tick: int) -> None:
        """Pull the payload toward the grip."""
        # What MuJoCo knows of the payload's pose is one step old, so the path is read there too.
        was = max(tick - 1, 0)
        position, R, moving, turning = self._at()
        tilt = _rotvec(R @ self._R[was].T)
        grip = self._grip
        force = grip.stiffness_N_per_m * (self._position[was] - position) + grip.damping_Ns_per_m * (
            self._velocity_of[was] - moving
        )
        moment = -grip.stiffness_Nm_per_rad * tilt + grip.damping_Nms_per_rad * (self._turning[was] - turning)
        self._press(force, moment, position)
        if tick % self._stage.ticks == 0:
            power = np.array(force @ moving + moment @ turning)
            self._rows.append((force, moment, self._position[was], position, tilt, power))


class PushingHand(_OnPayload):
    """A given force at a point of the payload: an actor of a trial.

    The force rises and falls as (1 - cos) / 2 over its duration, so its impulse is half of peak times duration.

    Args:
        point_1: where it pushes, in {1} [m], shape (3,).
        peak_N: largest force, in the world, shape (3,).
        start_s, duration_s: when [s].
    """

    def __init__(self, point_1: ArrayLike, peak_N: ArrayLike, start_s: float, duration_s: float) -> None:
        super().__init__(point_1)
        self._peak = np.asarray(peak_N, dtype=float)
        self._start_s, self._duration_s = start_s, duration_s
        if self._peak.shape != (3,) or not np.isfinite(self._peak).all() or not duration_s > 0:
            raise InputError("a push needs three finite forces and a duration greater than 0 s")

    def act(self, tick: int) -> None:
        """Push."""
        s = (tick / self._stage.rate_hz - self._start_s) / self._duration_s
        force = self._peak * (0.5 - 0.5 * np.cos(2.0 * np.pi * s) if 0.0 < s < 1.0 else 0.0)
        position, _, moving, _ = self._at()
        self._press(force, np.zeros(3), position)
        if tick % self._stage.ticks == 0:
            nothing = np.zeros(3)
            self._rows.append((force, nothing, position, position, nothing, np.array(force @ moving)))


def hand_path(moves: Sequence[Move], start_s: float, ticks: int, rate_hz: float) -> tuple[Array, Array]:
    """Displacement [m] and rotation vector [rad] of a hand at every tick, shapes (T, 3)."""
    time = np.arange(ticks) / rate_hz
    path, before = np.zeros((ticks, 6)), np.zeros(6)
    begin = start_s
    for move in moves:
        after = np.array([*move.by_m, *move.turn_rad])
        on = time > begin
        path[on] = before + minimum_jerk((time[on] - begin) / move.duration_s)[:, None] * (after - before)
        before, begin = after, begin + move.duration_s + move.rest_s
    return path[:, :3], path[:, 3:]


# MuJoCo's small-vector functions: numpy's and scipy's cost more than a step of the physics.


def _cross(a: Array, b: Array) -> Array:
    product = np.empty(3)
    mujoco.mju_cross(product, a, b)
    return product


def _rotvec(R: Array) -> Array:
    quaternion, rotvec = np.empty(4), np.empty(3)
    mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(R).ravel())
    mujoco.mju_quat2Vel(rotvec, quaternion, 1.0)
    return rotvec
