"""What noise of the sensors leaves in rows, and how signals are adjusted towards the model."""

from __future__ import annotations

import numpy as np

from estimator.arrays import Array
from estimator.calibrate.equations.rows import Rows
from estimator.rigid_team.slots import COUNT as SLOTS

# Value, rate and acceleration of each joint; the three torques.
_CHAINS = [np.array([first + k + 3 * order for order in range(3)]) for first in (0, 9) for k in range(3)] + [
    np.arange(18, 21)
]


def covariance_of(J: Array, noise: Array) -> Array:
    """Covariance of the rows' residual, shape (n, C, C).

    Args:
        J: derivative by the rows' signals, shape (n, C, N, ``SLOTS``).
        noise: theirs, as ``noise_of`` has it.
    """
    total = np.zeros((len(J), J.shape[1], J.shape[1]))
    for robot in range(J.shape[2]):
        for joint, at in enumerate(_CHAINS):
            part = J[:, :, robot, at]
            total += part @ noise[:, robot, joint] @ np.swapaxes(part, 1, 2)
    return total


def adjustment_of(J: Array, noise: Array, covariance: Array, residual: Array) -> Array:
    """The likeliest change of the rows' signals that makes loops and balance close, shape (n, N, ``SLOTS``).

    Args:
        J, noise: as for ``covariance_of``.
        covariance: what that gives.
        residual: what is to be closed, shape (n, C).
    """
    weighed = np.linalg.solve(covariance, residual[..., None])
    out = np.zeros((len(J), J.shape[2], SLOTS))
    for robot in range(J.shape[2]):
        for joint, at in enumerate(_CHAINS):
            moved = noise[:, robot, joint] @ (np.swapaxes(J[:, :, robot, at], 1, 2) @ weighed)
            out[:, robot, at] -= moved[..., 0]
    return out


def noise_of(rows: Rows, variances: tuple[Array, Array]) -> Array:
    """Covariance of every joint's (value, rate, acceleration) and of every torque in the rows: (n, N, 7, 3, 3)."""
    moving, held = variances
    n, N = moving.shape[:2]
    out = np.zeros((n, N, 7, 3, 3))
    at = slice(0, rows.moving)
    out[at, :, :6] = moving[at, :, :6, None, None] * rows.gain
    out[at, :, 6, range(3), range(3)] = moving[at, :, 6:] * rows.gain[0, 0]
    at = slice(rows.moving, None)
    out[at, :, :6, 0, 0] = held[at, :, :6]
    out[at, :, 6, range(3), range(3)] = held[at, :, 6:]
    return out
