"""A loose grasp."""

import math

import numpy as np
from scipy.ndimage import binary_dilation

from discrepancy import rules
from discrepancy.causes.free_while import in_parts, pieces_while
from discrepancy.team.causes.base import Cause, stack
from discrepancy.team.linear.trial_linear import TrialLinear
from estimator.arrays import Array


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
        force = trial.data.wrench[:, robot, 3:]
        at_end = -np.clip(force / shape["force_N"], -1.0, 1.0)
        return stack([displaced(trial, robot, at_end, force)])

    def unknowns(self, trial, robot, joint, shape):
        force, rate_hz = trial.data.wrench[:, robot, 3:], trial.signals.rate_hz
        around = np.ones(2 * math.ceil(rules.PLAY_OPEN_S * rate_hz) + 1, dtype=bool)
        columns = [np.zeros((*trial.residual.shape, 0))]
        for axis in range(3):
            loose = binary_dilation(np.abs(force[:, axis]) < rules.PLAY_OPEN_N, around)
            places = in_parts(
                pieces_while(loose, rate_hz, rules.PLAY_OPEN_KNOTS_S), rules.PLAY_COLUMNS_AT_A_TIME
            )
            along = trial.data.R_bi[:, robot, :, axis] @ trial.bases.R[robot].T
            columns.append(trial.of_shifts(robot, along, places))
        return np.concatenate(columns, axis=2)


def displaced(trial: TrialLinear, robot: int, offset: Array, force: Array) -> Array:
    """Rows of an offset of the grasp along the axes of {i} under a force in them [N], shape (Q, 3) each.

    The force still goes through the gimbal's centre, of which the payload is off by so much.
    """
    in_b = np.einsum("qij,qj->qi", trial.data.R_bi[:, robot], offset)
    moment = np.cross(force, offset) @ trial.shared.grasps.R_1i[robot].T
    rows = trial.of_pose(robot, None, in_b @ trial.bases.R[robot].T)
    return np.asarray(rows + trial.of_wrench(np.zeros_like(moment), moment))
