"""A person's hands on the payload: a spring-damper that moves along a path, or a force that is given."""

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from estimator.arrays import Array
from estimator.errors import InputError
from mocobot_sim.trial.actors import Stage
from mocobot_sim.trial.trajectories import minimum_jerk


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
