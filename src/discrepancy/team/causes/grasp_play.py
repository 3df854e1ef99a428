"""A loose grasp."""

import numpy as np

from discrepancy.team.causes.base import Cause, stack


class GraspPlay(Cause):
    """The payload rests against one end of its play on every axis of {i}, after the force on it.

    ``force_N`` is the force at which it has settled there.
    """

    name = "grasp_play"
    family = "compliance"
    parameters = ("play_m",)
    per = "robot"
    shapes = ({"force_N": 0.1}, {"force_N": 0.02}, {"force_N": 0.5})
    positive = ("play_m",)
    separate = "Internal forces of both signs at rest separate play from flexibility."

    def columns(self, trial, robot, joint, shape):
        at_end = -np.tanh(trial.data.wrench[:, robot, 3:] / shape["force_N"])
        in_b = np.einsum("qij,qj->qi", trial.data.R_bi[:, robot], at_end)
        return stack([trial.of_pose(robot, None, in_b @ trial.bases.R[robot].T)])
