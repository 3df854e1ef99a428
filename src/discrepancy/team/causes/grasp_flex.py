"""A grasp that yields."""

from typing import ClassVar

import numpy as np

from discrepancy import rules
from discrepancy.team.causes.base import stack
from discrepancy.team.causes.yielding import Yielding, lagging
from estimator.arm.gimbal import rate_matrix
from estimator.rigid_team.slots import THETA


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
        *Yielding.shapes,
        *({"relaxation_s": rules.RELAXATIONS_S[0], "offset_m": offset_m} for offset_m in rules.GRASP_TURNS_M),
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
        least_m, most_m = rules.GRASP_TURNS_RANGE_M
        offsets_m = (shape["offset_m"] * share for share in rules.GRASP_TURNS_FINER)
        near = [{**shape, "offset_m": x} for x in offsets_m if least_m <= abs(x) <= most_m]
        return [*({**shape, **time} for time in times), *near]

    def columns(self, trial, robot, joint, shape):
        R_bi, R_1 = trial.data.R_bi[:, robot], trial.bases.R[robot].T
        force = np.einsum("qij,qj->qi", R_bi, trial.data.wrench[:, robot, 3:])
        force = lagging(force, trial.signals.rate_hz, shape)
        gives = trial.of_pose(robot, None, -force @ R_1)
        turns = np.zeros_like(gives)
        if "offset_m" in shape:
            axis, offset_m = R_bi[..., 2], shape["offset_m"]
            across = force - np.sum(force * axis, axis=1, keepdims=True) * axis
            turned = np.sign(offset_m) * np.cross(axis, force)  # of the payload, in {b}
            # The gimbal reads its own side of the grasp, which has not turned.
            in_i = np.swapaxes(R_bi, -1, -2) @ turned[..., None]
            angles = np.linalg.solve(rate_matrix(trial.s[:, robot, THETA]), in_i)[..., 0]
            turns = trial.of_pose(robot, None, -abs(offset_m) * across @ R_1)
            turns += trial.of_signals(robot, theta=-angles)
        return stack([gives, turns])

    def physical(self, values, context):
        turning = float(values[1]) if "offset_m" in context.shape else 0.0
        return super().physical(values, context) | {"turning_rad_per_N": turning}
