"""A loose grasp."""

import numpy as np

from discrepancy import rules
from discrepancy.causes.free_while import free_while
from discrepancy.team.causes.base import Cause, stack


class GraspPlay(Cause):
    """The payload rests against one end of its play on every axis of {i}, after the force on it.

    Below ``force_N`` it has not settled there, and is anywhere between the ends.
    """

    title = "play in {grasp}"
    family = "compliance"
    parameters = ("play_m",)
    tolerances = (3e-6,)
    at = "grasp"
    shapes = ({"force_N": rules.PLAY_FORCE_N},)
    positive = ("play_m",)
    separate = "Internal forces of both signs at rest separate play from flexibility."

    def sentence(self, n):
        return f"the grasp is loose by +-({n('play_m', 'um', 1e6)}) along each axis"

    def columns(self, trial, robot, joint, shape):
        at_end = -np.clip(trial.data.wrench[:, robot, 3:] / shape["force_N"], -1.0, 1.0)
        return stack([_moved(trial, robot, at_end)])

    def unknowns(self, trial, robot, joint, shape):
        between = np.abs(trial.data.wrench[:, robot, 3:]) < shape["force_N"]
        columns = []
        for axis, unit in enumerate(np.eye(3)):
            for place in free_while(between[:, axis], trial.signals.rate_hz, rules.PLAY_KNOTS_S):
                column = _moved(trial, robot, place[:, None] * unit)
                if column.any():  # not before the first row or after the last
                    columns.append(column)
        return columns


def _moved(trial, robot, offset):
    """Rows of an offset of the grasp along the axes of {i}, shape (Q, 3)."""
    in_b = np.einsum("qij,qj->qi", trial.data.R_bi[:, robot], offset)
    return trial.of_pose(robot, None, in_b @ trial.bases.R[robot].T)
