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
    form_share = rules.FRICTION_FORM_SHARE
    separate = "Internal forces of both signs at rest separate play from flexibility."

    def sentence(self, n):
        return f"the grasp is loose by +-({n('play_m', 'um', 1e6)}) along each axis"

    def columns(self, trial, robot, joint, shape):
        at_end = -np.clip(trial.data.wrench[:, robot, 3:] / shape["force_N"], -1.0, 1.0)
        return stack([_moved(trial, robot, at_end)])

    def unknowns(self, trial, robot, joint, shape):
        between = np.abs(trial.data.wrench[:, robot, 3:]) < shape["force_N"]
        columns = []
        for axis in range(3):
            along = (trial.bases.R[robot] @ trial.data.R_bi[:, robot])[..., axis, None]
            places = free_while(between[:, axis], trial.signals.rate_hz, rules.PLAY_KNOTS_S)
            for first in range(0, len(places), 16):  # not all at once, for the sake of memory
                some = np.stack(places[first : first + 16], axis=-1)
                moved = trial.of_pose(robot, None, along * some[:, None])
                # Not before the first row or after the last.
                columns.append(moved[..., moved.any(axis=(0, 1))])
        return np.concatenate([np.zeros((*trial.residual.shape, 0)), *columns], axis=2)


def _moved(trial, robot, offset):
    """Rows of an offset of the grasp along the axes of {i}, shape (Q, 3)."""
    in_b = np.einsum("qij,qj->qi", trial.data.R_bi[:, robot], offset)
    return trial.of_pose(robot, None, in_b @ trial.bases.R[robot].T)
