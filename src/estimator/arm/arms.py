"""Robots as designed or as they are: one way from what their sensors read to what their arms do."""

from __future__ import annotations

from estimator.arm.design import OmnidDesign
from estimator.arm.unit import ArmUnit
from estimator.arrays import Array

Arms = OmnidDesign | ArmUnit
"""One arm or several: as designed, all alike, or as they are, side by side in leading axes of ``ArmUnit.x``."""


def design_of(arms: Arms) -> OmnidDesign:
    """What arms are meant to be."""
    return arms.design if isinstance(arms, ArmUnit) else arms


def arm_of(arms: Arms, robot: int) -> Arms:
    """The arm of one robot (from 0) among several."""
    return ArmUnit(arms.design, arms.x[robot]) if isinstance(arms, ArmUnit) else arms


def true_joints(arms: Arms, phi: Array, theta: Array, tau: Array) -> tuple[Array, Array, Array]:
    """True driven angles [rad], gimbal angles [rad] and spring torques [N m] from readings, shape (..., 3) each.

    Arms as designed read the truth: the arrays themselves come back.
    """
    if not isinstance(arms, ArmUnit):
        return phi, theta, tau
    return phi - arms.of("phi_zero"), theta - arms.of("theta_zero"), arms.true_tau(tau)


def levelled(arms: Arms, R: Array, h: Array) -> tuple[Array, Array]:
    """Orientations (..., 3, 3) and wrists (..., 3) [m] from the arms' own frames to {b}, which is level."""
    if not isinstance(arms, ArmUnit) or not arms.of("tilt").any():
        return R, h
    return arms.R_ba @ R, (arms.R_ba @ h[..., None])[..., 0]
