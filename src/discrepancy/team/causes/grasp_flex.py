"""A grasp that yields."""

import numpy as np

from discrepancy.team.causes.base import stack
from discrepancy.team.causes.yielding import Yielding, lagging


class GraspFlex(Yielding):
    """The payload's grasp site stays behind the flange, giving way to the force on the payload."""

    title = "compliance of {grasp}"
    at = "grasp"
    separate = (
        "Vertical forces (lifting against each other) separate a grasp from a base, which yields sideways."
    )

    def sentence(self, n):
        return (
            f"the grasp is flexible: it gives way by {n('compliance_m_per_N', 'um/N', 1e6)}, and follows the force "
            f"within {n('relaxation_s', 'ms', 1e3)}"
        )

    def columns(self, trial, robot, joint, shape):
        force = np.einsum("qij,qj->qi", trial.data.R_bi[:, robot], trial.data.wrench[:, robot, 3:])
        force = lagging(force, trial.signals.rate_hz, shape)
        return stack([trial.of_pose(robot, None, -force @ trial.bases.R[robot].T)])
