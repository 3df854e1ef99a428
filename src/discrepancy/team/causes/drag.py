"""Viscous drag on the payload."""

import numpy as np

from discrepancy.team.causes.base import Cause, stack
from estimator.arrays import Array
from estimator.estimate.fusion import fuse, fusion_matrix


class Drag(Cause):
    """Force -c v on the payload at its centre of mass, and a moment -c_r omega."""

    title = "drag on the payload"
    family = "dissipation"
    parameters = ("coefficient_Ns_per_m", "turning_Nms_per_rad")
    tolerances = (0.05, 0.01)  # the second: the first at half a metre
    at = "payload"
    positive = ("coefficient_Ns_per_m", "turning_Nms_per_rad")
    clipped = ("turning_Nms_per_rad",)
    separate = "Translation at constant attitude separates drag of the payload from friction of the gimbals."

    def sentence(self, n):
        return (
            f"the payload's motion is resisted by {n('coefficient_Ns_per_m', 'N s/m', signed=True)}, its turning by "
            f"{n('turning_Nms_per_rad', 'N m s/rad', signed=True)}"
        )

    def columns(self, trial, robot, joint, shape):
        motion = fuse(trial.data, trial.shared.grasps)
        twist: Array = trial.data.twist.reshape(len(trial.s), -1) @ fusion_matrix(trial.shared.grasps).T
        com = trial.shared.pi[1:4] / trial.shared.pi[0]
        force = np.asarray(-(twist[:, 3:] + np.cross(motion.omega, com)), dtype=np.float64)
        moment = np.asarray(-motion.omega, dtype=np.float64)
        return stack(
            [
                trial.of_wrench(force, np.cross(com, force).astype(np.float64)),
                trial.of_wrench(np.zeros_like(moment), moment),
            ]
        )
