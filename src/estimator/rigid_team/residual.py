"""The stacked residual of one trial: rigid grasps between robots, and Newton-Euler of the payload.

Per instant 6 N numbers. For every robot i >= 2, with the poses of the bases constant,

    e_rot = log(R_b1bi R_bi R_1i^T R_b1^T),   e_pos = p_b1bi + R_b1bi h_i - h_1 - R_b1 p_1i    (axes of {b1})

and once (f, M) - Y pi: the sum of the robots' wrenches at the origin of {1} against the payload's ten inertial
parameters. All are zero, at every instant, for a rigid payload in ideal robots.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from estimator import so3
from estimator.arm.arms import Arms, levelled
from estimator.arm.delta import forward_kinematics
from estimator.arm.gimbal import rotation
from estimator.arrays import Array
from estimator.estimate.fusion import fuse
from estimator.estimate.grasp_estimate import GraspEstimate
from estimator.estimate.joint import newton_euler_regressor
from estimator.signals.arm_data import ArmData, arm_data
from estimator.signals.grasp_data import GraspData


@dataclass(frozen=True, eq=False)
class Shared:
    """What all trials have in common: how the payload is held, and its inertial parameters.

    Attributes:
        grasps: grasp frames X_1i.
        pi: (m, m c, J about {1}), shape (10,).
    """

    grasps: GraspEstimate
    pi: Array

    def moved(self, x: Array) -> Shared:
        """Changed by x = (d_i, e_i for i >= 2, pi), shape (6 (N - 1) + 10,)."""
        split = 6 * (self.grasps.robots - 1)
        return replace(self, grasps=self.grasps.moved(x[:split]), pi=self.pi + x[split:])


@dataclass(frozen=True, eq=False)
class Bases:
    """Poses of the robots' bases in {b1} during one trial; index 0 is robot 1 itself.

    Attributes:
        R: rotations about z, shape (N, 3, 3).
        p: positions [m], shape (N, 3).
    """

    R: Array
    p: Array

    def moved(self, x: Array) -> Bases:
        """Changed by x = (dx, dy, dz, dyaw for i >= 2), shape (4 (N - 1),)."""
        x = x.reshape(-1, 4)
        turn = Rotation.from_rotvec(np.column_stack([np.zeros((len(x), 2)), x[:, 3]])).as_matrix()
        return Bases(
            np.concatenate([self.R[:1], turn @ self.R[1:]]),
            np.concatenate([self.p[:1], self.p[1:] + x[:, :3]]),
        )


def poses(phi: Array, theta: Array, arms: Arms) -> tuple[Array, Array]:
    """R_bi and h [m] in level base frames, (..., N, 3, 3) and (..., N, 3), from true angles (..., N, 3)."""
    return levelled(arms, rotation(theta), forward_kinematics(phi, arms))


def pose_residual(phi: Array, theta: Array, shared: Shared, bases: Bases, arms: Arms) -> Array:
    """e_rot [rad] and e_pos [m] of the robots i >= 2, shape (Q, 6 (N - 1)), from true angles (Q, N, 3)."""
    return pose_error(*poses(phi, theta, arms), shared, bases)


def pose_error(R: Array, h: Array, shared: Shared, bases: Bases) -> Array:
    """The same from R_bi (Q, N, 3, 3) and h (Q, N, 3)."""
    grasps = shared.grasps
    parts = []
    for i in range(1, grasps.robots):
        back = R[:, 0] @ grasps.R_1i[i]  # R_b1 R_1i
        parts.append(Rotation.from_matrix(bases.R[i] @ R[:, i] @ np.swapaxes(back, -1, -2)).as_rotvec())
        parts.append(bases.p[i] + h[:, i] @ bases.R[i].T - h[:, 0] - R[:, 0] @ grasps.p_1i[i])
    return np.concatenate(parts, axis=1) if parts else np.zeros((len(R), 0))


def robot_data(s: Array, arms: Arms) -> ArmData:
    """R_bi and h in level base frames, twist, twist_dot and wrench of robots whose true signals are s (``slots``).

    Args:
        s: shape (Q, ..., 21).
        arms: of one robot, or of all in the axis before the last.
    """
    phi, phi_dot, phi_ddot, theta, theta_dot, theta_ddot, tau = np.moveaxis(
        s.reshape(*s.shape[:-1], 7, 3), -2, 0
    )
    data = arm_data((phi, phi_dot, phi_ddot), (theta, theta_dot, theta_ddot), tau, arms)
    R_bi, h = levelled(arms, data.R_bi, data.h)
    return data._replace(R_bi=R_bi, h=h)


def balance(data: GraspData, shared: Shared) -> tuple[Array, Array]:
    """(f, M) of the robots minus Y pi [N, N m], shape (Q, 6), and Y, shape (Q, 6, 10)."""
    motion = fuse(data, shared.grasps)
    Y = newton_euler_regressor(
        motion.omega, motion.alpha, motion.acceleration + data.gravity_mps2 * motion.up
    )
    return np.concatenate([motion.force, motion.moment], axis=1) - Y @ shared.pi, Y


def grasp_data(s: Array, arms: Arms, rate_hz: float) -> GraspData:
    """Data points of all robots from true signals s, shape (Q, N, 21); time is not needed here."""
    R, h, twist, twist_dot, wrench = robot_data(s, arms)
    return GraspData(np.zeros(len(s)), R, h, twist, twist_dot, wrench, rate_hz, arms.gravity_mps2)


def start_bases(R: Array, h: Array, shared: Shared) -> Bases:
    """Bases of one trial, in which all robots agree on average about where the payload is.

    Args:
        R: orientations R_bi, shape (Q, N, 3, 3).
        h: wrist positions in {b} [m], shape (Q, N, 3).
        shared: how the payload is held.
    """
    turns, places = [np.eye(3)], [np.zeros(3)]
    for i in range(1, h.shape[1]):
        mean = so3.chordal_mean(R[:, 0] @ shared.grasps.R_1i[i] @ np.swapaxes(R[:, i], -1, -2))
        yaw = np.arctan2(mean[1, 0] - mean[0, 1], mean[0, 0] + mean[1, 1])
        turns.append(Rotation.from_rotvec([0.0, 0.0, yaw]).as_matrix())
        places.append(np.mean(h[:, 0] + R[:, 0] @ shared.grasps.p_1i[i] - h[:, i] @ turns[i].T, axis=0))
    return Bases(np.array(turns), np.array(places))
