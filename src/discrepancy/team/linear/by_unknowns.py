"""Derivative of a trial's residual by its unknowns: how the payload is held, its inertia, where the bases are."""

import numpy as np
from scipy.spatial.transform import Rotation

from estimator.arrays import Array
from estimator.rigid_team import Bases, Shared, balance
from estimator.signals import GraspData
from estimator.so3 import inverse_left_jacobian

STEP = 1e-5
"""Of grasps [rad, m], both ways, by which the balance of wrenches is differenced."""


def by_shared(data: GraspData, shared: Shared, bases: Bases) -> Array:
    """Derivative of the residual's samples by ``Shared.moved``, shape (Q, 6 N, 6 (N - 1) + 10).

    A loop knows its own robot's grasp alone. Its rotation is log(E), and a grasp that turns by d in {1} makes E
    exp(-R_b1 d) of E.
    """
    N, split = data.robots, 6 * (data.robots - 1)
    out = np.zeros((data.samples, 6 * N, split + 10))
    out[:, split:, split:] = -balance(data, shared)[1]
    for k in range(split):
        step = STEP * np.eye(split + 10)[k]
        ends = (balance(data, shared.moved(sign * step))[0] for sign in (1.0, -1.0))
        out[:, split:, k] = (next(ends) - next(ends)) / (2.0 * STEP)
    R_b1 = data.R_bi[:, 0]
    for i in range(1, N):
        about, along = _channels(i)
        out[:, about, about] = -inverse_left_jacobian(-_turned(data, shared, bases, i)) @ R_b1
        out[:, along, along] = -R_b1
    return out


def by_bases(data: GraspData, shared: Shared, bases: Bases) -> Array:
    """The same by ``Bases.moved``, shape (Q, 6 N, 4 (N - 1)); E of a base that turns is exp(yaw z) E."""
    N = data.robots
    out = np.zeros((data.samples, 6 * N, 4 * (N - 1)))
    for i in range(1, N):
        (about, along), column = _channels(i), 4 * (i - 1)
        out[:, along, column : column + 3] = np.eye(3)
        out[:, about, column + 3] = inverse_left_jacobian(_turned(data, shared, bases, i))[..., 2]
        out[:, along, column + 3] = np.cross([0.0, 0.0, 1.0], data.p_bi[:, i] @ bases.R[i].T)
    return out


def _channels(robot: int) -> tuple[slice, slice]:
    """Rotation and position of one robot's loop (from 0)."""
    return slice(6 * (robot - 1), 6 * robot - 3), slice(6 * robot - 3, 6 * robot)


def _turned(data: GraspData, shared: Shared, bases: Bases, robot: int) -> Array:
    """e_rot of one robot's loop, shape (Q, 3)."""
    back = data.R_bi[:, 0] @ shared.grasps.R_1i[robot]
    turned = bases.R[robot] @ data.R_bi[:, robot] @ np.swapaxes(back, -1, -2)
    return np.asarray(Rotation.from_matrix(turned).as_rotvec(), dtype=np.float64)
