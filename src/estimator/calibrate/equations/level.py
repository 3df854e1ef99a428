"""Readings of robots as they are, brought to true signals and to poses in level base frames."""

from __future__ import annotations

import numpy as np

from estimator.arm.unit import ArmUnit
from estimator.arrays import Array
from estimator.rigid_team.slots import PHI, TAU, THETA
from estimator.signals.arm_data import ArmData, arm_data


def corrected(s: Array, units: ArmUnit) -> Array:
    """True signals of the robots from what they read, shape (..., N, ``SLOTS``)."""
    s = s.copy()
    s[..., PHI] -= units.of("phi_zero")
    s[..., THETA] -= units.of("theta_zero")
    s[..., TAU] = units.true_tau(s[..., TAU])
    return s


def level_data(s: Array, units: ArmUnit) -> ArmData:
    """Poses in level base frames, twists and wrenches, of true signals (..., N, ``SLOTS``)."""
    phi, phi_dot, phi_ddot, theta, theta_dot, theta_ddot, tau = np.moveaxis(
        s.reshape(*s.shape[:-1], 7, 3), -2, 0
    )
    data = arm_data((phi, phi_dot, phi_ddot), (theta, theta_dot, theta_ddot), tau, units)
    if not units.of("tilt").any():
        return data
    return data._replace(R_bi=units.R_ba @ data.R_bi, h=(units.R_ba @ data.h[..., None])[..., 0])
