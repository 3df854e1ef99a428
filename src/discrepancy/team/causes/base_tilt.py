"""A base that does not stand level."""

import numpy as np

from discrepancy.team.causes.base import Cause, stack
from estimator.arm.delta import jacobian_of, leg_geometry
from estimator.rigid_team.slots import PHI


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
        grasps, bases, data, design = trial.shared.grasps, trial.bases, trial.data, trial.design
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
        legs = leg_geometry(trial.s[:, robot, PHI], trial.arm(robot))
        at_knee = (
            design.proximal_mass_kg * design.proximal_com_m / design.proximal_length_m
            + 0.5 * design.rod_mass_kg
        )
        at_wrist = design.wrist_mass_kg + 1.5 * design.rod_mass_kg
        torque = g * (
            at_knee * (legs.knee_d1 @ up_b) + at_wrist * np.einsum("qij,i->qj", jacobian_of(legs), up_b)
        )
        return trial.reduction(raw) + trial.of_signals(robot, tau=torque)
