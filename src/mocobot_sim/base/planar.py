"""Planar poses (x [m], y [m], yaw [rad]) and planar body twists (w_z [rad/s], v_x, v_y [m/s])."""

import numpy as np
from numpy.typing import ArrayLike

from estimator.arrays import Array


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
