"""Lengths of links and tilts of bases."""

from functools import partial

import numpy as np

from discrepancy.team.causes.base import Cause, ReadingError, one_joint, stack
from estimator.arm.delta import LEG_DIRECTIONS, jacobian_of, leg_geometry
from estimator.arm.motion import PHI


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

    def errors(self, signals, robot, joint, shape, arm):
        angle, torque = _errors(signals.phi[:, robot], signals.tau[:, robot], joint, arm)
        return [{"phi": one_joint(a, joint), "tau": t} for a, t in zip(angle, torque, strict=True)]


def _errors(phi, tau, joint, arm):
    """Readings minus those of a leg of the arm's lengths, per metre: angles (3, Q) and torques (3, Q, 3)."""
    angle, slopes = _phi_error(phi, joint, arm)
    at, leg = phi[:, joint], partial(_of_leg, joint=joint)
    at_knee = 0.5 * arm.gravity_mps2 * leg(arm.rod_mass_kg)
    weight = arm.gravity_mps2 * leg(arm.proximal_mass_kg) * arm.proximal_com_m + at_knee * leg(
        arm.proximal_length_m
    )
    # (I - d(error)/d(phi))^-T on what drives the wrist, to first order ...
    torque = -slopes * (tau[:, joint] - weight * np.cos(at))[:, None]
    # ... and the weight of link and knee at another angle, and of the knee on a longer lever.
    torque[:, :, joint] -= weight * np.sin(at) * angle
    torque[0, :, joint] += at_knee * np.cos(at)
    return angle, torque


def _of_leg(values, joint):
    """A number of one leg: as designed all are alike."""
    return np.broadcast_to(values, 3)[joint]


def _phi_error(phi, joint, arm):
    """Reading minus the angle at which a leg of the arm's lengths would reach the same wrist, per metre, shape (3, Q).

    And its derivative by the three angles, (3, Q, 3). It is minus what the rod has of a longer link, a longer rod or a
    wider base, over the rod's leverage.
    """
    legs, own = leg_geometry(phi, arm), np.eye(3)[joint]
    rod, knee, lever = legs.rod[:, joint], legs.knee_d1[:, joint], legs.leverage[:, joint]
    u, up, angle = LEG_DIRECTIONS[joint], np.eye(3)[2], phi[:, joint]
    along = np.cos(angle)[:, None] * u + np.sin(angle)[:, None] * up
    across = np.cos(angle)[:, None] * up - np.sin(angle)[:, None] * u
    length = np.full(len(phi), _of_leg(arm.rod_length_m, joint))
    shares = np.stack([np.sum(rod * along, axis=1), length, rod @ u])
    # By every angle the wrist moves, and by the leg's own the knee does.
    rod_moves = jacobian_of(legs) - knee[..., None] * own  # (Q, 3, 3)
    of_along = np.einsum("qij,qi->qj", rod_moves, along) + np.sum(rod * across, axis=1)[:, None] * own
    of_lever = (
        np.einsum("qij,qi->qj", rod_moves, knee) + np.sum(rod * legs.knee_d2[:, joint], axis=1)[:, None] * own
    )
    of_shares = np.stack([of_along, np.zeros_like(of_along), np.einsum("qij,i->qj", rod_moves, u)])
    error = -shares / lever
    return error, -(of_shares + error[..., None] * of_lever) / lever[:, None]


class BaseTilt(Cause):
    """{b} is turned by the rotation vector (roll, pitch, 0), in its own axes; yaw is an unknown of each trial."""

    title = "tilt of {base}"
    family = "base_tilt"
    parameters = ("roll_rad", "pitch_rad")
    tolerances = (1e-4, 1e-4)
    at = "robot"
    separate = "Larger tilts of the payload, and holds."

    def sentence(self, n):
        return (
            f"the base does not stand level: turned by {n('roll_rad', 'mrad', 1e3, signed=True)} about its x axis and "
            f"{n('pitch_rad', 'mrad', 1e3, signed=True)} about its y axis"
        )

    def columns(self, trial, robot, joint, shape):
        return stack([self._column(trial, robot, np.eye(3)[k]) for k in range(2)])

    @staticmethod
    def _column(trial, robot, rho):
        grasps, bases, data, arm = trial.shared.grasps, trial.bases, trial.data, trial.arm(robot)
        samples = len(trial.s)
        raw = np.zeros((samples, trial.channels))
        turn = bases.R[robot] @ rho  # in {b1}
        for i in range(1, trial.robots):
            at = 6 * (i - 1)
            place = data.p_bi[:, i] @ bases.R[i].T
            if robot == 0:
                raw[:, at : at + 3] = turn
                raw[:, at + 3 : at + 6] = np.cross(turn, bases.p[i] + place)
            elif robot == i:
                raw[:, at : at + 3] = -turn
                raw[:, at + 3 : at + 6] = -np.cross(turn, place)
        up_b = -np.cross(rho, [0.0, 0.0, 1.0])  # change of the vertical in {b}
        g, mass, mass_c = data.gravity_mps2, trial.shared.pi[0], trial.shared.pi[1:4]
        up = np.einsum("qji,j->qi", data.R_bi[:, robot], up_b) @ grasps.R_1i[robot].T / trial.robots
        raw[:, -6:-3] = mass * g * up
        raw[:, -3:] = np.cross(mass_c, g * up)
        # The arm's own weight, which the balance takes off the torques.
        legs = leg_geometry(trial.s[:, robot, PHI], arm)
        at_knee = arm.proximal_mass_kg * arm.proximal_com_m / arm.proximal_length_m + 0.5 * arm.rod_mass_kg
        at_wrist = arm.wrist_mass_kg + 0.5 * np.sum(np.broadcast_to(arm.rod_mass_kg, 3))
        torque = g * (
            at_knee * (legs.knee_d1 @ up_b) + at_wrist * np.einsum("qij,i->qj", jacobian_of(legs), up_b)
        )
        return trial.reduction(raw) + trial.of_signals(robot, tau=torque)
