"""Motion of an Omnid's bodies from its joint angles alone: the closed chain solved, not simulated.

The rods and the platform carry no sensor; the Delta's kinematics places them. Each body moves against a frame that is
fixed in its parent (see ``robot.PATHS``), either turning about that frame's origin or shifting without turning, so a
viewer that knows the tree needs no more than what varies.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from estimator.arm.delta import LEG_DIRECTIONS, leg_geometry
from estimator.arm.unit import Arms
from estimator.arrays import Array
from mocobot_view.bodies.robot import GIMBAL, LEGS


@dataclass(frozen=True)
class BodyMotion:
    """How the bodies of N robots move at Q samples.

    Attributes:
        wrist: positions of the platform in the arm's own frame [m], which is {b} where that stands level, (Q, N, 3).
        turns: quaternions (x, y, z, w) of the links, rods and gimbal bodies in their fixed frames, by name,
            shape (Q, N, 4).
    """

    wrist: Array
    turns: dict[str, Array]


def body_motion(phi: Array, theta: Array, arms: Arms) -> BodyMotion:
    """Solve the arms and gimbals of all robots.

    A link turns by phi about minus its driven axis, the rod by Ry(swing) Rz(tilt) against the link.

    Args:
        phi: true driven angles [rad], shape (Q, N, 3).
        theta: true gimbal angles (theta_z, theta_y, theta_x) [rad], shape (Q, N, 3).
        arms: the robots as they are, or as designed.

    Raises:
        InputError: the rods do not meet at some sample.
    """
    wrist, swing, tilt = rod_angles(phi, arms)
    turns = {}
    for leg in LEGS:
        turns[f"proximal{leg}"] = _turned("Y", -phi[..., leg - 1])
        turns[f"rod{leg}"] = _turned("YZ", swing[..., leg - 1], tilt[..., leg - 1])
    for column, (name, axis) in enumerate(zip(GIMBAL, "ZYX", strict=True)):
        turns[name] = _turned(axis, theta[..., column])
    return BodyMotion(wrist, turns)


def rod_angles(phi: Array, arms: Arms) -> tuple[Array, Array, Array]:
    """Where the arms are, from the driven angles alone.

    Seen from the knee, the rod's direction (x, y, z) in the link is
    Ry(swing) Rz(tilt) e_x = (cos swing cos tilt, sin tilt, -sin swing cos tilt).

    Args:
        phi: true driven angles [rad], shape (..., N, 3).
        arms: the robots as they are, or as designed.

    Returns:
        Wrist positions in the arms' own frames [m], and swing and tilt of each leg's rod against its link [rad]; shapes
        (..., 3).

    Raises:
        InputError: the rods do not meet at some sample.
    """
    legs = leg_geometry(phi, arms)
    length = np.broadcast_to(np.asarray(arms.rod_length_m), legs.h.shape)[..., None]
    swing, tilt = np.empty_like(legs.h), np.empty_like(legs.h)
    for k, u in enumerate(LEG_DIRECTIONS):
        angle, rod = phi[..., k], legs.rod[..., k, :] / length[..., k, :]
        outward, aside, up = rod @ u, rod @ [-u[1], u[0], 0.0], rod[..., 2]
        x = np.cos(angle) * outward + np.sin(angle) * up
        z = np.cos(angle) * up - np.sin(angle) * outward
        swing[..., k], tilt[..., k] = np.arctan2(-z, x), np.arcsin(np.clip(aside, -1.0, 1.0))
    return legs.h, swing, tilt


def _turned(axes: str, *angles: Array) -> Array:
    """Quaternions of turns about coordinate axes that turn along, one after the other; shape (..., 4)."""
    rows = np.stack(angles, axis=-1)
    return Rotation.from_euler(axes, rows.reshape(-1, len(axes))).as_quat().reshape(*rows.shape[:-1], 4)
