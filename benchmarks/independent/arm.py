"""The Delta arm and its gimbal: kinematics and loads in reduced coordinates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from estimator.arm.design import OmnidDesign
from independent.numerics import Array, about, back_turned, derivative, second_derivative, turned

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


def gimbal_angles(R: Array) -> Array:
    """(theta_z, theta_y, theta_x) [rad] with R = Rz Ry Rx, (Q, 3, 3) to (Q, 3)."""
    z = np.arctan2(R[:, 1, 0], R[:, 0, 0])
    y = np.arctan2(-R[:, 2, 0], np.hypot(R[:, 0, 0], R[:, 1, 0]))
    x = np.arctan2(R[:, 2, 1], R[:, 2, 2])
    return np.stack([z, y, x], axis=-1)


def gimbal_moment(theta: Array, resisting: Array, design: OmnidDesign) -> Array:
    """Moment of the gimbal on the payload.

    Args:
        theta: angles (z, y, x) on the fine grid [rad], shape (Q, 3).
        resisting: torque that has to be overcome about each axis, positive while its angle grows [N m], (Q, 3).
        design: the gimbal's inertia.

    Returns:
        Moment on the payload in the arm's frame [N m], shape (Q, 3).
    """
    yoke = about(2, theta[:, 0])
    ring = yoke @ about(1, theta[:, 1])
    flange = ring @ about(0, theta[:, 2])
    axes = np.stack([np.broadcast_to([0.0, 0.0, 1.0], theta.shape), yoke[:, :, 1], ring[:, :, 0]], axis=1)
    turns = np.cumsum(axes * derivative(theta)[..., None], axis=1)
    needed = []
    for body, R in enumerate((yoke, ring, flange)):
        moments = (design.yoke_inertia_kgm2, design.ring_inertia_kgm2, design.flange_inertia_kgm2)[body]
        needed.append(derivative(turned(R, back_turned(R, turns[:, body]) * np.asarray(moments))))
    # About axis j only what lies beyond it turns.
    beyond = np.cumsum(np.stack(needed[::-1], axis=1), axis=1)[:, ::-1]
    about_axes = (beyond * axes).sum(-1) + resisting
    return -np.linalg.solve(axes, about_axes[..., None])[..., 0]


@dataclass(frozen=True, eq=False)
class ArmLoad:
    """What an arm's own masses ask for.

    Attributes:
        phi: driven angles [rad], shape (Q, 3).
        to_phi: d phi / d h [rad/m], shape (Q, 3, 3).
        link_torque: of the driven links alone [N m], shape (Q, 3).
        force: at the wrist, of rods and what translates, in the arm's frame [N], shape (Q, 3).
        floor: what the floor has to give to all that moves, in the arm's frame [N], shape (Q, 3).
    """

    phi: Array
    to_phi: Array
    link_torque: Array
    force: Array
    floor: Array

    def spring_torque(self, wrist_force: Array) -> Array:
        """Torques on the links [N m] if the wrist pushes with a force [N, arm's frame] on the payload, (Q, 3)."""
        # A virtual shift of the wrist: sum over legs of torque x (d phi / d h) = force.
        total = (self.force + wrist_force)[..., None]
        return np.linalg.solve(np.swapaxes(self.to_phi, -1, -2), total)[..., 0] + self.link_torque


def arm_load(h: Array, legs: Legs, design: OmnidDesign, gravity: Array) -> ArmLoad:
    """The arm's share at a motion of the wrist.

    Args:
        h: wrist in the arm's frame on the fine grid [m], shape (Q, 3).
        legs: the arm's lengths.
        design: masses.
        gravity: less the base's own acceleration, in the arm's frame [m/s^2], shape (Q, 3).
    """
    phi = driven_angles(h, legs)
    rate, acceleration = derivative(phi)[..., None], second_derivative(phi)[..., None]
    along, forward = link_directions(phi)
    to_phi = rates(phi, h, legs)
    # Accelerations less gravity at both ends of each rod, and at a driven link's centre of mass, shape (Q, 3, 3).
    per_metre = acceleration * forward - rate**2 * along
    down = gravity[:, None, :]
    knee = legs.proximal[:, None] * per_metre - down
    wrist = second_derivative(h) - gravity
    tip = np.broadcast_to(wrist[:, None, :], knee.shape)
    mass = design.rod_mass_kg
    # A uniform slender rod's points move linearly between its ends: integrals of s^2, s(1-s), (1-s)^2 over its length.
    at_knee, at_tip = mass / 6 * (2 * knee + tip), mass / 6 * (knee + 2 * tip)
    link_torque = (
        design.proximal_inertia_kgm2 * acceleration[..., 0]
        - design.proximal_mass_kg * design.proximal_com_m * (down * forward).sum(-1)
        + legs.proximal * (at_knee * forward).sum(-1)
    )
    moving = design.platform_mass_kg + design.yoke_mass_kg + design.ring_mass_kg + design.flange_mass_kg
    link = design.proximal_mass_kg * (design.proximal_com_m * per_metre - down)
    force = moving * wrist + at_tip.sum(axis=1)
    floor = moving * wrist + (at_knee + at_tip + link).sum(axis=1)
    return ArmLoad(phi, to_phi, link_torque, force, floor)
