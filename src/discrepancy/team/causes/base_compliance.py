"""A base that gives way to the horizontal force on it."""

import numpy as np

from discrepancy.team.causes.base import Cause, stack
from estimator.arm.delta import leg_geometry, wrist_motion
from estimator.rigid_team.slots import PHI, PHI_DDOT, PHI_DOT


class BaseCompliance(Cause):
    """The base moves by compliance times the horizontal force, which is the reaction to arm and payload."""

    title = "compliance of {base}"
    family = "compliance"
    parameters = ("compliance_m_per_N",)
    tolerances = (1e-7,)
    at = "robot"
    positive = ("compliance_m_per_N",)
    separate = (
        "Vertical forces (lifting against each other) separate a base, which yields sideways, from a grasp."
    )

    def sentence(self, n):
        return f"the base gives way horizontally, by {n('compliance_m_per_N', 'um/N', 1e6)}"

    def columns(self, trial, robot, joint, shape):
        design, s = trial.design, trial.s[:, robot]
        force = np.einsum("qij,qj->qi", trial.data.R_bi[:, robot], trial.data.wrench[:, robot, 3:])
        _, h_ddot = wrist_motion(leg_geometry(s[:, PHI], trial.arm(robot)), s[:, PHI_DOT], s[:, PHI_DDOT])
        force = force + (design.wrist_mass_kg + 1.5 * design.rod_mass_kg) * h_ddot
        horizontal = -force * np.array([1.0, 1.0, 0.0])
        return stack([trial.of_pose(robot, None, horizontal @ trial.bases.R[robot].T)])
