"""Readings of robots as they are, brought to true signals."""

from __future__ import annotations

from estimator.arm.arms import true_joints
from estimator.arm.unit import ArmUnit
from estimator.arrays import Array
from estimator.rigid_team.slots import PHI, TAU, THETA


def corrected(s: Array, units: ArmUnit) -> Array:
    """True signals of the robots from what they read, shape (..., N, ``SLOTS``)."""
    s = s.copy()
    s[..., PHI], s[..., THETA], s[..., TAU] = true_joints(units, s[..., PHI], s[..., THETA], s[..., TAU])
    return s
