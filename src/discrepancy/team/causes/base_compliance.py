"""A base that gives way to the horizontal force on it."""

import numpy as np

from discrepancy.team.causes.base import stack
from discrepancy.team.causes.yielding import Yielding, lagging
from estimator.arm.delta import leg_geometry, wrist_motion
from estimator.rigid_team.slots import PHI, PHI_DDOT, PHI_DOT


class BaseCompliance(Yielding):
    """The base gives way to the horizontal force, which is the reaction to arm and payload."""

    title = "compliance of {base}"
    at = "robot"
    separate = (
        "Vertical forces (lifting against each other) separate a base, which yields sideways, from a grasp."
    )

    def sentence(self, n):
        return (
            f"the base gives way horizontally, by {n('compliance_m_per_N', 'um/N', 1e6)}, and follows the force within "
            f"{n('relaxation_s', 'ms', 1e3)}"
        )

    def columns(self, trial, robot, joint, shape):
        design, s = trial.design, trial.s[:, robot]
        force = np.einsum("qij,qj->qi", trial.data.R_bi[:, robot], trial.data.wrench[:, robot, 3:])
        _, h_ddot = wrist_motion(leg_geometry(s[:, PHI], trial.arm(robot)), s[:, PHI_DOT], s[:, PHI_DDOT])
        force = force + (design.wrist_mass_kg + 1.5 * design.rod_mass_kg) * h_ddot
        horizontal = lagging(-force * np.array([1.0, 1.0, 0.0]), trial.signals.rate_hz, shape)
        return stack([trial.of_pose(robot, None, horizontal @ trial.bases.R[robot].T)])
