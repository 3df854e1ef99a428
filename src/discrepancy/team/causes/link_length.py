"""Lengths of one leg: proximal link, rod, and radius of the base (less that of the platform)."""

import numpy as np

from discrepancy import rules
from discrepancy.team.causes.base import ReadingError, one_joint
from estimator.arm.delta import LEG_DIRECTIONS, leg_geometry


class LinkLength(ReadingError):
    """True length minus design.

    At the same wrist the leg's joint then stands at another angle: a length is an error of phi that depends on the
    pose, and by virtual power one of the torques. What hangs on the link and at the knee takes no part in that: it
    is weighed at the true angle.
    """

    title = "lengths of {leg}"
    family = "arm_geometry"
    adjusted = True
    parameters = ("proximal_m", "rod_m", "base_radius_m")
    tolerances = (2e-5, 2e-5, 2e-5)
    separate = "Poses spread over the whole workspace separate a wrong length from an encoder's zero."

    def sentence(self, n):
        parts = zip(
            self.parameters, ("the driven link is", "the rods are", "the base radius is"), strict=True
        )
        words = [
            f"{what} {n(name, 'mm', 1e3)} {n.either(name, 'too long', 'too short')}"
            for name, what in parts
            if n.values.get(name)
        ]
        return "the leg deviates from its design: " + (", ".join(words) or "by nothing that shows")

    def possible(self, values, se, shape):
        """No leg is built that far from its drawing: such values stand for something else."""
        return bool(np.all(np.abs(values) < rules.LENGTH_MOST_M))

    def errors(self, signals, robot, joint, shape, design):
        angle, torque = _errors(signals.phi[:, robot], signals.tau[:, robot], joint, design)
        return [{"phi": one_joint(a, joint), "tau": t} for a, t in zip(angle, torque, strict=True)]


def _errors(phi, tau, joint, design):
    """Readings minus those of a leg of design lengths, per metre: angles (3, Q) and torques (3, Q, 3)."""
    angle, slopes = np.array(_phi_error(phi, joint, design)), _slopes(phi, joint, design)
    gravity, at = design.gravity_mps2, phi[:, joint]
    at_knee = 0.5 * design.rod_mass_kg * gravity
    weight = design.proximal_mass_kg * gravity * design.proximal_com_m + at_knee * design.proximal_length_m
    # (I - d(error)/d(phi))^-T on what drives the wrist, to first order ...
    torque = -slopes * (tau[:, joint] - weight * np.cos(at))[:, None]
    # ... and the weight of link and knee at another angle, and of the knee on a longer lever.
    torque[:, :, joint] -= weight * np.sin(at) * angle
    torque[0, :, joint] += at_knee * np.cos(at)
    return angle, torque


def _slopes(phi, joint, design, step=1e-5):
    """Derivative of ``_phi_error`` by the three angles, shape (3, Q, 3)."""
    slopes = np.empty((3, *phi.shape))
    for leg, direction in enumerate(np.eye(3)):
        ahead, behind = (_phi_error(phi + s * direction, joint, design) for s in (step, -step))
        slopes[:, :, leg] = (np.array(ahead) - np.array(behind)) / (2.0 * step)
    return slopes


def _phi_error(phi, joint, design):
    """Reading minus the angle at which a leg of design lengths would reach the same wrist, per metre: three (Q,)."""
    legs = leg_geometry(phi, design)
    rod, lever = legs.rod[:, joint], legs.leverage[:, joint]
    u, angle = LEG_DIRECTIONS[joint], phi[:, joint]
    along = np.cos(angle)[:, None] * u + np.sin(angle)[:, None] * np.array([0.0, 0.0, 1.0])
    return [-np.sum(rod * along, axis=1) / lever, -design.rod_length_m / lever, -(rod @ u) / lever]
