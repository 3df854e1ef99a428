"""A grasp that yields."""

import numpy as np

from discrepancy.team.causes.base import Cause, stack


class GraspFlex(Cause):
    """The payload's grasp site lags behind the flange by compliance times the force on the payload."""

    title = "compliance of {grasp}"
    family = "compliance"
    parameters = ("compliance_m_per_N",)
    tolerances = (1e-7,)
    at = "grasp"
    positive = ("compliance_m_per_N",)
    separate = (
        "Vertical forces (lifting against each other) separate a grasp from a base, which yields sideways."
    )

    def sentence(self, n):
        return f"the grasp is flexible and gives way by {n('compliance_m_per_N', 'um/N', 1e6)}"

    def columns(self, trial, robot, joint, shape):
        force = np.einsum("qij,qj->qi", trial.data.R_bi[:, robot], trial.data.wrench[:, robot, 3:])
        return stack([trial.of_pose(robot, None, -force @ trial.bases.R[robot].T)])
