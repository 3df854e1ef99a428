"""Geometry of a Delta arm whose legs have lengths of their own: from the wrist to the driven angles and back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from estimator.arm.design import OmnidDesign
from independent.numerics import Array

AZIMUTH = np.radians([0.0, 120.0, 240.0])
OUT = np.stack([np.cos(AZIMUTH), np.sin(AZIMUTH), np.zeros(3)], axis=-1)
"""Directions of the legs in the arm's frame, shape (3, 3): leg, axis."""
UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class Legs:
    """Lengths of one arm's legs [m], shape (3,) each.

    Attributes:
        radius: driven axes' radius less the platform joints'.
        proximal: driven axis to knee.
        rod: knee to platform joint.
    """

    radius: Array
    proximal: Array
    rod: Array


def legs_of(design: OmnidDesign, radius: Array, proximal: Array, rod: Array) -> Legs:
    """Legs that are off the design by so much [m], shape (3,) each."""
    nominal = design.base_radius_m - design.platform_radius_m
    return Legs(nominal + radius, design.proximal_length_m + proximal, design.rod_length_m + rod)


def driven_angles(h: Array, legs: Legs) -> Array:
    """Driven angles with the knees outward.

    Args:
        h: wrist in the arm's frame [m], shape (Q, 3).
        legs: the arm's lengths.

    Returns:
        phi [rad], shape (Q, 3): 0 level and outward, positive raises the knee; NaN out of reach.
    """
    # Seen from the driven axis, moved inward by the platform's radius, the platform joint is at d; the knee lies on
    # a circle of radius l about the axis in the plane of u and z: d.u cos phi + d.z sin phi = (d^2 + l^2 - L^2) / 2 l.
    d = h[:, None, :] - legs.radius[:, None] * OUT
    along, up = (d * OUT).sum(-1), d[..., 2]
    right = ((d * d).sum(-1) + legs.proximal**2 - legs.rod**2) / (2 * legs.proximal)
    with np.errstate(invalid="ignore"):
        return np.arctan2(up, along) - np.arccos(right / np.hypot(along, up))


def link_directions(phi: Array) -> tuple[Array, Array]:
    """Unit vectors along the driven links, and where their tips go as phi grows, shape (Q, 3, 3): leg, axis."""
    c, s = np.cos(phi)[..., None], np.sin(phi)[..., None]
    return c * OUT + s * UP, -s * OUT + c * UP


def wrist_position(phi: Array, legs: Legs, start: Array) -> Array:
    """Wrist that belongs to driven angles, by Newton's method on the rods' lengths.

    Args:
        phi: driven angles [rad], shape (Q, 3).
        legs: the arm's lengths.
        start: where to start from [m], shape (3,).

    Returns:
        h in the arm's frame [m], shape (Q, 3).
    """
    along, _ = link_directions(phi)
    centre = legs.radius[:, None] * OUT + legs.proximal[:, None] * along
    h = np.broadcast_to(start, phi.shape).copy()
    for _ in range(30):
        rod = h[:, None, :] - centre
        gap = (rod * rod).sum(-1) - legs.rod**2
        h -= np.linalg.solve(2 * rod, gap[..., None])[..., 0]
    return h


def rates(phi: Array, h: Array, legs: Legs) -> Array:
    """d phi / d h [rad/m], shape (Q, 3, 3): leg, axis of h."""
    along, forward = link_directions(phi)
    rod = h[:, None, :] - legs.radius[:, None] * OUT - legs.proximal[:, None] * along
    # rod . (dh - l forward dphi) = 0 keeps a rod's length.
    return rod / (legs.proximal * (rod * forward).sum(-1))[..., None]
