"""Planned planar motion of a frame, and of bases that stay where they are under it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from estimator.arrays import Array
from estimator.errors import InputError
from mocobot_sim.trial.trajectories import LONGEST_S, minimum_jerk


def compose(pose: ArrayLike, of: ArrayLike) -> Array:
    """Pose in the world of what has the pose ``of`` in the frame ``pose``; shapes (..., 3) broadcast."""
    pose, of = np.broadcast_arrays(np.asarray(pose, dtype=float), np.asarray(of, dtype=float))
    cos, sin = np.cos(pose[..., 2]), np.sin(pose[..., 2])
    x, y = of[..., 0], of[..., 1]
    return pose + np.stack([cos * x - sin * y, sin * x + cos * y, of[..., 2]], axis=-1)


def relative(frame: ArrayLike, pose: ArrayLike) -> Array:
    """Pose of ``pose`` as seen from ``frame``, both in the world, yaw within +-pi; shapes (..., 3) broadcast."""
    frame, pose = np.asarray(frame, dtype=float), np.asarray(pose, dtype=float)
    away = pose - frame
    return np.concatenate([seen_from(frame[..., 2], away[..., :2]), wrapped(away[..., 2:])], axis=-1)


def seen_from(yaw: ArrayLike, vector: ArrayLike) -> Array:
    """Vectors (x, y) in the axes of frames that are turned by ``yaw`` [rad]; shapes (...), (..., 2) -> (..., 2)."""
    x, y = np.moveaxis(np.asarray(vector, dtype=float), -1, 0)
    cos, sin = np.cos(yaw), np.sin(yaw)
    return np.stack([cos * x + sin * y, cos * y - sin * x], axis=-1)


def wrapped(angle: ArrayLike) -> Array:
    """The same angle within +-pi [rad]."""
    return (np.asarray(angle, dtype=float) + np.pi) % (2.0 * np.pi) - np.pi


def moved(pose: ArrayLike, step: ArrayLike) -> Array:
    """Pose after a constant body twist has acted for a while: odometry (Modern Robotics, section 13.4).

    Args:
        pose: before, shape (..., 3).
        step: body twist times time (turn [rad], along x, along y [m]), shape (..., 3).
    """
    pose, step = np.broadcast_arrays(np.asarray(pose, dtype=float), np.asarray(step, dtype=float))
    turn, x, y = step[..., 0], step[..., 1], step[..., 2]
    # The chord of an arc is turned by half the arc's angle and shorter by the sinc of that.
    shorter = np.sinc(turn / (2.0 * np.pi))
    heading = pose[..., 2] + 0.5 * turn
    cos, sin = np.cos(heading), np.sin(heading)
    return pose + np.stack([shorter * (cos * x - sin * y), shorter * (sin * x + cos * y), turn], axis=-1)


def yaw_of(R: ArrayLike) -> Array:
    """Yaw of rotations near level [rad], shape (..., 3, 3) -> (...): the heading of their x axis."""
    R = np.asarray(R, dtype=float)
    return np.arctan2(R[..., 1, 0], R[..., 0, 0])


@dataclass(frozen=True)
class Leg:
    """One straight piece of a plan; the frame starts and ends it at rest, with minimum jerk.

    Attributes:
        to: pose at its end in the world: x, y [m], yaw [rad].
        duration_s: time to get there, greater than 0 [s].
        rest_s: time at rest there [s].
    """

    to: tuple[float, float, float]
    duration_s: float
    rest_s: float = 0.0


@dataclass(frozen=True)
class PlanarMotion:
    """Where frames are meant to be at every tick; N frames.

    Attributes:
        rate_hz: ticks per second [Hz].
        pose: x, y [m], yaw [rad] in the world, shape (T, N, 3).
        twist: w_z [rad/s], v_x, v_y [m/s] in each frame, shape (T, N, 3).
    """

    rate_hz: float
    pose: Array
    twist: Array

    @property
    def duration_s(self) -> float:
        """From the first tick to the last [s]."""
        return (len(self.pose) - 1) / self.rate_hz


def plan(start: ArrayLike, legs: Sequence[Leg], rest_s: float, rate_hz: float = 1000.0) -> PlanarMotion:
    """Motion of one frame along straight legs.

    Args:
        start: pose at the beginning: x, y [m], yaw [rad].
        legs: what to do, one after the other; yaw is not wrapped, so 2 pi is a full turn.
        rest_s: time at rest before the first leg [s].
        rate_hz: ticks per second [Hz].

    Raises:
        InputError: there is no leg, a number is not finite, a duration is not positive or the whole lasts over an hour.
    """
    if not legs:
        raise InputError("a plan has no legs; it needs at least one")
    poses = [np.asarray(pose, dtype=float) for pose in (start, *(leg.to for leg in legs))]
    if not all(pose.shape == (3,) and np.isfinite(pose).all() for pose in poses):
        raise InputError("a plan's poses are not x, y and yaw, all finite; they must be")
    stations = np.array(poses)
    times = np.array([[leg.duration_s, leg.rest_s] for leg in legs], dtype=float)
    if not (times[:, 0] > 0).all() or not (times[:, 1] >= 0).all() or not rest_s >= 0:
        raise InputError("a leg must last longer than 0 s and a rest 0 s or more")
    duration = rest_s + times.sum()
    if not duration <= LONGEST_S:
        raise InputError(f"the plan lasts {duration:g} s; it may last {LONGEST_S:g} s at most")
    time = np.arange(round(duration * rate_hz) + 1) / rate_hz
    pose, rate = np.tile(stations[0], (len(time), 1)), np.zeros((len(time), 3))
    begin = rest_s
    for k, leg in enumerate(legs):
        s = (time - begin) / leg.duration_s
        on = s > 0
        step = stations[k + 1] - stations[k]
        pose[on] = stations[k] + minimum_jerk(s[on])[:, None] * step
        within = np.clip(s[on], 0.0, 1.0)
        rate[on] = (30.0 * within**2 * (1.0 - within) ** 2 / leg.duration_s)[:, None] * step
        begin += leg.duration_s + leg.rest_s
    twist = np.column_stack([rate[:, 2], seen_from(pose[:, 2], rate[:, :2])])
    return PlanarMotion(rate_hz, pose[:, None], twist[:, None])


def carried(motion: PlanarMotion, places: ArrayLike) -> PlanarMotion:
    """Motion of N frames that are fixed to a moving one: what bases do that stay put under a moving payload.

    Args:
        motion: of one frame.
        places: where the N frames are in the world at the beginning: x, y [m], yaw [rad], shape (N, 3).
    """
    lead, twist = motion.pose[:, 0], motion.twist[:, 0]
    held = relative(lead[0], np.asarray(places, dtype=float))  # poses in the moving frame, (N, 3)
    pose = compose(lead[:, None], held[None])
    # Velocity of the held origins in the moving frame, turned into their own axes.
    x, y, yaw = held.T
    turn, v_x, v_y = (part[:, None] for part in twist.T)
    velocity = seen_from(yaw, np.stack([v_x - turn * y, v_y + turn * x], axis=-1))
    turns = np.broadcast_to(turn[..., None], (*velocity.shape[:2], 1))
    return PlanarMotion(motion.rate_hz, pose, np.concatenate([turns, velocity], axis=-1))
