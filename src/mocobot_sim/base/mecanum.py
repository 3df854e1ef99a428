"""Kinematics of a base on four mecanum wheels: wheel speeds from a body twist, and back.

A roller turns freely about its axle and rolls on the floor, so it can slide without force along one horizontal
direction only, across its axle; along its axle e its contact sticks. The contact of wheel k, at (x, y) on the chassis,
moves with v + w z x (x, y), minus R u along x where u is the wheel's speed, so

    e . (v_x - w y - R u, v_y + w x) = 0,    e = (sin a, s cos a)
    u = (v_x - w y + s cot(a) (v_y + w x)) / R

with a the angle between the axles of roller and wheel and s = +-1 the wheel's hand. With a = 45 deg this is equation
(13.10) of K. M. Lynch and F. C. Park, "Modern Robotics", Cambridge University Press, 2017.

The textbook's roller always touches with its middle. One of n straight axles is turned about the wheel's axle by up to
pi / n while it carries the wheel; at angle t only sin a cos t of its axle lies along the wheel's motion. A wheel that
turns evenly passes all t alike, so the mean of cos t, sin(pi / n) / (pi / n), belongs into cot a: 12 rollers go 1.1 %
less far sideways than the textbook says. ``with_rollers`` has this mean in it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from estimator.arrays import Array
from mocobot_sim.base.design import HAND, BaseDesign


@dataclass(frozen=True)
class MecanumKinematics:
    """Linear map between planar body twists (w_z, v_x, v_y) and wheel speeds, wheels in the order of ``WHEELS``.

    Attributes:
        matrix: wheel speeds per twist, shape (4, 3); columns [1, 1/m, 1/m].
        inverse: its pseudo-inverse, the twist that fits four wheel speeds best, shape (3, 4).
    """

    matrix: Array
    inverse: Array

    @classmethod
    def textbook(cls, design: BaseDesign) -> MecanumKinematics:
        """Every roller touches with its middle."""
        return cls._with(design, 1.0)

    @classmethod
    def with_rollers(cls, design: BaseDesign) -> MecanumKinematics:
        """On average over a turn of wheels with so many straight rollers."""
        return cls._with(design, axle_share(design))

    @classmethod
    def _with(cls, design: BaseDesign, share: float) -> MecanumKinematics:
        x, y = design.wheel_positions.T
        across = HAND / (np.tan(design.roller_angle_rad) * share)
        matrix = np.stack([across * x - y, np.ones(4), across], axis=1) / design.wheel_radius_m
        return cls(matrix, np.asarray(np.linalg.pinv(matrix), dtype=np.float64))

    def wheel_speeds(self, twist: ArrayLike) -> Array:
        """Speeds [rad/s], shape (..., 4), for twists (w_z [rad/s], v_x, v_y [m/s]), shape (..., 3)."""
        return np.asarray(twist, dtype=float) @ self.matrix.T

    def twist(self, wheel_speeds: ArrayLike) -> Array:
        """Twists, shape (..., 3), that fit wheel speeds [rad/s], shape (..., 4), in the sense of least squares."""
        return np.asarray(wheel_speeds, dtype=float) @ self.inverse.T


def axle_share(design: BaseDesign) -> float:
    """Mean of the cosine of the angle by which a roller's axle is turned while the roller carries the wheel."""
    half_pitch = np.pi / design.rollers
    return float(np.sin(half_pitch) / half_pitch)
