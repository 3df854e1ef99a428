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

    def columns(self, trial, robot, joint, shape):  # noqa: D102
        phi, tau = trial.s[:, robot, :3], trial.s[:, robot, 18:]
        error = _phi_error(phi, joint, trial.design)
        columns = []
        for k in range(3):
            slope = np.empty_like(phi)
            for leg in range(3):
                step = 1e-5 * np.eye(3)[leg]
                ahead, behind = (_phi_error(phi + s, joint, trial.design)[k] for s in (step, -step))
                slope[:, leg] = (ahead - behind) / 2e-5
            # (I - d(error)/d(phi))^-T on the torque, to first order.
            torque = -slope * tau[:, joint, None]
            columns.append(trial.of_signals(robot, phi=one_joint(error[k], joint), tau=torque))
        return stack(columns)

    def undo(self, signals, trial, robot, joint, values, shape):  # noqa: D102
        phi = signals.phi[:, robot]
        error = values @ np.array(_phi_error(phi, joint, trial.design))
        slope = np.empty_like(phi)
        for leg in range(3):
            step = 1e-5 * np.eye(3)[leg]
            ahead, behind = (
                values @ np.array(_phi_error(phi + s, joint, trial.design)) for s in (step, -step)
            )
            slope[:, leg] = (ahead - behind) / 2e-5
        torque = -slope * signals.tau[:, robot, joint, None]
        return signals.minus(
            phi=one_robot(one_joint(error, joint), trial.robots, robot),
            tau=one_robot(torque, trial.robots, robot),
        )


def _phi_error(phi, joint, design):
    """Reading minus the angle at which a leg of design lengths would reach the same wrist, per metre: three (Q,)."""
    legs = leg_geometry(phi, design)
    rod, lever = legs.rod[:, joint], legs.leverage[:, joint]
    u, angle = LEG_DIRECTIONS[joint], phi[:, joint]
    along = np.cos(angle)[:, None] * u + np.sin(angle)[:, None] * np.array([0.0, 0.0, 1.0])
    return [-np.sum(rod * along, axis=1) / lever, -design.rod_length_m / lever, -(rod @ u) / lever]
