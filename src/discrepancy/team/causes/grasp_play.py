"""A loose grasp."""

import math
from typing import ClassVar

import numpy as np
from scipy.ndimage import binary_dilation

from discrepancy.team.causes.base import Cause, stack
from discrepancy.team.causes.free_while import in_parts, pieces_while
from discrepancy.team.linear.rest import PLAY_FORCE_N
from discrepancy.team.linear.trial_linear import TrialLinear
from estimator.arrays import Array

PLAY_COLUMNS_AT_A_TIME = 16
"""Of that travel. Chosen: memory."""

PLAY_CONTACT_PER_N = 0.02
"""Of a play, by which its ends give way to a newton, over which slopes are taken. Chosen: 1 um/N behind 50 um; columns
go straight with it."""

PLAY_OPEN_KNOTS_S = 0.05
"""Between knots of that travel. Measured: play of 0.8 mm leaves a chi2/n of 51 with knots every 0.2 s and forces below
0.4 N, 12 every 0.1 s below 1 N, 1.15 every 0.05 s; nothing faster passes the rows' filter."""

PLAY_OPEN_N, PLAY_OPEN_S = 1.0, 0.03
"""Force below which a payload that is loose may travel, and for how long before and after. Measured: it travels for a
tenth of a second, with forces of up to 1 N in the filtered signals where there should be none; and derived: so long a
filter of 20 Hz takes to show a force that begins. With 0.4 N alone, half of the travel is outside."""


class GraspPlay(Cause):
    """The payload rests against one end of its play on every axis of {i}, after the force on it.

    Below ``force_N`` it has not settled there, and is anywhere between the ends. The ends may give way to the force:
    by ``contact_per_N`` of the play, if that is in its shape.
    """

    title = "play in {grasp}"
    family = "compliance"
    parameters = ("play_m",)
    tolerances = (3e-6,)
    at = "grasp"
    shapes = ({"force_N": PLAY_FORCE_N}, {"force_N": PLAY_FORCE_N, "contact_per_N": 0.0})
    determined: ClassVar = {"contact_per_N": PLAY_CONTACT_PER_N}
    positive = ("play_m",)
    separate = "Internal forces of both signs at rest separate play from flexibility."

    def sentence(self, n):
        behind = ""
        if n.values.get("contact_m_per_N"):
            behind = f", and gives way by {n('contact_m_per_N', 'nm/N', 1e9)} behind"
        return f"the grasp is loose by +-({n('play_m', 'um', 1e6)}) along each axis{behind}"

    def slope_step(self, name, number):
        return self.determined[name]  # from nought on, and straight

    def physical(self, values, context):
        play_m = float(values[0])
        return {"play_m": play_m, "contact_m_per_N": play_m * context.shape.get("contact_per_N", 0.0)}

    def columns(self, trial, robot, joint, shape):
        force = trial.data.wrench[:, robot, 3:]
        end = np.clip(force / shape["force_N"], -1.0, 1.0)
        behind = shape.get("contact_per_N", 0.0) * force
        return stack([displaced(trial, robot, -end - behind, force)])

    def unknowns(self, trial, robot, joint, shape):
        force, rate_hz = trial.data.wrench[:, robot, 3:], trial.signals.rate_hz
        around = np.ones(2 * math.ceil(PLAY_OPEN_S * rate_hz) + 1, dtype=bool)
        columns = []
        for axis in range(3):
            small = np.abs(force[:, axis]) < PLAY_OPEN_N
            loose = np.asarray(binary_dilation(small, around), dtype=np.bool_)
            places = in_parts(pieces_while(loose, rate_hz, PLAY_OPEN_KNOTS_S), PLAY_COLUMNS_AT_A_TIME)
            along = trial.data.R_bi[:, robot, :, axis] @ trial.bases.R[robot].T
            columns.append(trial.of_shifts(robot, along, places))
        return columns[0].beside(columns[1:])


def displaced(trial: TrialLinear, robot: int, offset: Array, force: Array) -> Array:
    """Rows of an offset of the grasp along the axes of {i} under a force in them [N], shape (Q, 3) each.

    The force still goes through the gimbal's centre, of which the payload is off by so much.
    """
    in_b = np.einsum("qij,qj->qi", trial.data.R_bi[:, robot], offset)
    moment = np.cross(force, offset) @ trial.shared.grasps.R_1i[robot].T
    rows = trial.of_pose(robot, None, in_b @ trial.bases.R[robot].T)
    return np.asarray(rows + trial.of_wrench(np.zeros_like(moment), moment))
