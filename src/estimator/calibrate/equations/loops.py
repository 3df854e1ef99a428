"""Derivatives of the loops in closed form, averaged over each row as the residual itself is."""

from __future__ import annotations

import numpy as np

from estimator.arm.delta import jacobian_of, leg_geometry, length_jacobians
from estimator.arm.gimbal import rate_matrix, rotation
from estimator.arm.unit import AT, COUNT, ArmUnit
from estimator.arrays import Array
from estimator.calibrate.equations.level import corrected
from estimator.calibrate.equations.rows import Rows
from estimator.rigid_team.residual import Bases, Shared
from estimator.rigid_team.slots import PHI, THETA

_POSE = np.r_[
    AT["phi_zero"], AT["theta_zero"], AT["radius"], AT["proximal_length"], AT["rod_length"], AT["tilt"]
]
_AXES = np.eye(3)[:, :2]


def pose_derivatives(rows: Rows, units: ArmUnit, shared: Shared, bases: Bases) -> tuple[Array, Array, Array]:
    """Of the loops' 6 (N - 1) channels; n rows.

    Returns:
        By the robots' deviations, shape (n, 6 (N - 1), N, ``COUNT``), by ``Shared.moved``, (n, ., 6 (N - 1) + 10), and
        by ``Bases.moved``, (n, ., 4 (N - 1)).
    """
    s = corrected(rows.s, units)
    R_bi, h, turn, shift = _by_unit(s, units)
    n, N = len(rows.time), h.shape[1]
    channels = 6 * (N - 1)
    by_units = np.zeros((n, channels, N, COUNT))
    by_carried = np.zeros((n, channels, channels + 10))
    by_bases = np.zeros((n, channels, 4 * (N - 1)))
    R_b1 = rows(R_bi[:, 0])
    mean_turn, mean_shift, mean_h = rows(turn), rows(shift), rows(h)
    for j in range(1, N):
        about, along = slice(6 * (j - 1), 6 * (j - 1) + 3), slice(6 * (j - 1) + 3, 6 * j)
        lever = R_bi[:, 0] @ shared.grasps.p_1i[j]
        swept = rows(np.asarray(np.cross(turn[:, 0], lever[:, :, None], axis=1), dtype=np.float64))
        by_units[:, about, 0, _POSE] = -mean_turn[:, 0]
        by_units[:, along, 0, _POSE] = -mean_shift[:, 0] - swept
        by_units[:, about, j, _POSE] = bases.R[j] @ mean_turn[:, j]
        by_units[:, along, j, _POSE] = bases.R[j] @ mean_shift[:, j]
        by_carried[:, about, about] = by_carried[:, along, along] = -R_b1
        column, turned = 4 * (j - 1), mean_h[:, j] @ bases.R[j].T
        by_bases[:, along, column : column + 3] = np.eye(3)
        by_bases[:, about.start + 2, column + 3] = 1.0
        by_bases[:, along.start, column + 3] = -turned[:, 1]
        by_bases[:, along.start + 1, column + 3] = turned[:, 0]
    return by_units, by_carried, by_bases


def _by_unit(s: Array, units: ArmUnit) -> tuple[Array, Array, Array, Array]:
    """R_bi, h, and how deviations turn and shift them, shape (q, N, 3, len(_POSE)), in level base frames."""
    phi, theta = s[..., PHI], s[..., THETA]
    legs = leg_geometry(phi, units)
    R_ai = rotation(theta)
    shift = np.zeros((*phi.shape, len(_POSE)))
    turn = np.zeros_like(shift)
    shift[..., :3] = -jacobian_of(legs)
    turn[..., 3:6] = -(R_ai @ rate_matrix(theta))
    for k, part in enumerate(length_jacobians(legs, phi, units)):
        shift[..., 6 + 3 * k : 9 + 3 * k] = part
    R_ba = units.R_ba
    R_bi, h = R_ba @ R_ai, (R_ba @ legs.h[..., None])[..., 0]
    turn, shift = R_ba @ turn, R_ba @ shift
    turn[..., 15:] = _AXES
    shift[..., 15:] = np.cross(_AXES.T, h[..., None, :]).swapaxes(-1, -2)
    return R_bi, h, turn, shift
