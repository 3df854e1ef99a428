"""Lengths of one leg: proximal link, rod, and radius of the base (less that of the platform)."""

import numpy as np

from discrepancy.team.causes.base import Cause, one_joint, one_robot, stack
from estimator.delta import LEG_DIRECTIONS, leg_geometry


class LinkLength(Cause):
    """True length minus design.

    At the same wrist the leg's joint then stands at another angle: a length is an error of phi that depends on the
    pose, and by virtual power one of the torques.
    """

    name = "link_length"
    family = "arm_geometry"
    parameters = ("proximal_m", "rod_m", "base_radius_m")
    separate = "Poses spread over the whole workspace separate a wrong length from an encoder's zero."

    def columns(self, trial, robot, joint, shape):
        phi, tau = trial.s[:, robot, :3], trial.s[:, robot, 18:]
        columns = []
        errors, slopes = _phi_error(phi, joint, trial.design), _slopes(phi, joint, trial.design)
        for error, slope in zip(errors, slopes, strict=True):
            # (I - d(error)/d(phi))^-T on the torque, to first order.
            torque = -slope * tau[:, joint, None]
            columns.append(trial.of_signals(robot, phi=one_joint(error, joint), tau=torque))
        return stack(columns)

    def undo(self, signals, trial, robot, joint, values, shape):
        phi = signals.phi[:, robot]
        error = values @ np.array(_phi_error(phi, joint, trial.design))
        slope = np.tensordot(values, _slopes(phi, joint, trial.design), axes=1)
        torque = -slope * signals.tau[:, robot, joint, None]
        return signals.minus(
            phi=one_robot(one_joint(error, joint), trial.robots, robot),
            tau=one_robot(torque, trial.robots, robot),
        )


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
