"""Torques that the springs of one Delta arm have to give, by virtual work on its links, rods and platform."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from estimator.arm.design import OmnidDesign
from independent.arm.delta import Legs, driven_angles, link_directions, rates
from independent.numerics import Array, derivative, second_derivative


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
