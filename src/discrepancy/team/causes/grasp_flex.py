"""A grasp that yields."""

from typing import ClassVar

import numpy as np

from discrepancy.team import constants
from discrepancy.team.causes.base import stack
from discrepancy.team.causes.yielding import Yielding, lagging
from discrepancy.team.linear.trial_linear import TrialLinear
from estimator.arm.gimbal import rate_matrix
from estimator.arrays import Array
from estimator.rigid_team.slots import THETA

GRASP_TURNS_FINER, GRASP_TURNS_RANGE_M = (0.5, 0.7, 1.4, 2.0), (0.01, 0.3)
"""Shares of that tried next, and its range. Derived: nearer, nothing turns; farther, it is no part of the grasp."""

GRASP_TURNS_M = (0.05, -0.05)
"""From the gimbal's centre to the point about which a grasp turns, along its axis, tried first. Chosen: a flange's
thickness or a gripper's, on either side; what is along it is found by Gauss-Newton."""


class GraspFlex(Yielding):
    """The payload's grasp site stays behind the flange, giving way to the force on the payload.

    It may turn besides, about a point on the grasp's axis at ``offset_m`` from the gimbal's centre (along z of {i}).
    The gimbal passes no moment, so the moment about that point is its distance times the force across the axis, and
    the turning goes with the force: ``turning_rad_per_N`` is compliance in rotation times distance. Without such a
    point in its shape it does not turn.
    """

    title = "compliance of {grasp}"
    parameters = ("compliance_m_per_N", "turning_rad_per_N")
    tolerances = (1e-7, 1e-6)  # the second: bolts 7 cm apart that give way as much, 5 cm off the gimbal
    positive = ("compliance_m_per_N", "turning_rad_per_N")
    clipped = ("turning_rad_per_N",)
    at = "grasp"
    shapes = (
        *({"relaxation_s": time_s} for time_s in sorted(constants.RELAXATIONS_S)),  # no base moves along
        *({"relaxation_s": min(constants.RELAXATIONS_S), "offset_m": offset_m} for offset_m in GRASP_TURNS_M),
    )
    determined: ClassVar = {**Yielding.determined, "offset_m": 0.1}
    separate = (
        "Vertical forces (lifting against each other) separate a grasp from a base, which yields sideways."
    )

    def sentence(self, n):
        turns = ""
        if n.values.get("offset_m"):
            turns = f", turns by {n('turning_rad_per_N', 'mrad/N', 1e3)} of force across it about a point "
            turns += f"{n('offset_m', 'mm', 1e3, signed=True)} along its axis from the gimbal's centre"
        gives = f"gives way by {n('compliance_m_per_N', 'um/N', 1e6)}{turns}"
        return (
            f"the grasp is flexible: it {gives}, and follows the force within {n('relaxation_s', 'ms', 1e3)}"
        )

    def finer(self, shape):
        times = super().finer(shape)
        if "offset_m" not in shape:
            return times
        least_m, most_m = GRASP_TURNS_RANGE_M
        offsets_m = (shape["offset_m"] * share for share in GRASP_TURNS_FINER)
        near = [{**shape, "offset_m": x} for x in offsets_m if least_m <= abs(x) <= most_m]
        return [*({**shape, **time} for time in times), *near]

    def columns(self, trial, robot, joint, shape):
        R_bi, to_b1 = trial.data.R_bi[:, robot], trial.bases.R[robot]
        # Its springs turn with it, and so does what lags in them.
        force = lagging(trial.data.wrench[:, robot, 3:], trial.signals.rate_hz, shape)
        gives = _moved(trial, robot, to_b1 @ R_bi, -force)
        turns = np.zeros_like(gives)
        if "offset_m" in shape:
            offset_m = shape["offset_m"]
            across = force * [1.0, 1.0, 0.0]
            turned = np.sign(offset_m) * np.cross([0.0, 0.0, 1.0], force)  # of the payload
            # The gimbal reads its own side of the grasp, which has not turned.
            angles = np.linalg.solve(rate_matrix(trial.s[:, robot, THETA]), turned[..., None])[..., 0]
            turns = _moved(trial, robot, to_b1 @ R_bi, -abs(offset_m) * across)
            turns += trial.of_signals(robot, theta=-angles)
        return stack([gives, turns])

    def physical(self, values, context):
        offset_m = context.shape.get("offset_m", 0.0)
        turning = float(values[1]) if offset_m else 0.0
        return super().physical(values, context) | {"turning_rad_per_N": turning, "offset_m": offset_m}


def _moved(trial: TrialLinear, robot: int, R_b1i: Array, by: Array) -> Array:
    """Rows of a grasp that is displaced along the axes of {i}, shape (Q, 3)."""
    return trial.of_pose(robot, None, np.einsum("qij,qj->qi", R_b1i, by))
