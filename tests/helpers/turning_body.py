"""Gimbal angles of robots that hold one turning rigid body, at any instants of their own clocks.

Analytic, and without the estimator: R_bi = R_1i^T R R_1i for a body that turns as R(t) and grasps R_1i.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from rigid_body_data import body_pose

RATE_HZ = 100.0
GRASPS = Rotation.from_rotvec([[0.0, 0.0, 0.0], [0.4, -0.9, 1.7], [-0.2, 0.5, -2.2]])
"""R_1i of three robots."""


def swaying(time: np.ndarray) -> Rotation:
    """Sums of sines about all axes, 0.3 to 0.8 Hz, without a common period."""
    return Rotation.from_matrix(body_pose(time)[0])


def theta_at(time: np.ndarray, robot: int, motion: Callable[[np.ndarray], Rotation] = swaying) -> np.ndarray:
    """Gimbal angles (z, y, x) of one robot (from 0) at true times [s], shape (Q, 3)."""
    grasp = GRASPS[robot]
    return (grasp.inv() * motion(np.asarray(time)) * grasp).as_euler("ZYX")


def clocked(
    offset_s: Sequence[float],
    drift: Sequence[float],
    duration_s: float = 40.0,
    motion: Callable[[np.ndarray], Rotation] = swaying,
    starts_s: Sequence[float] = (0.0, 0.0, 0.0),
) -> tuple[list[np.ndarray], np.ndarray]:
    """Angles and first stamps of robots whose clocks are off: stamp = t + offset + drift (t - middle of robot 1)."""
    theta = []
    middle = starts_s[0] + (round(duration_s * RATE_HZ) - 1) / RATE_HZ / 2
    for i, (o, d, start) in enumerate(zip(offset_s, drift, starts_s, strict=False)):
        stamp = start + np.arange(round(duration_s * RATE_HZ)) / RATE_HZ
        theta.append(theta_at(middle + (stamp - middle - o) / (1.0 + d), i, motion))
    return theta, np.array(starts_s[: len(theta)], dtype=float)
