"""Drag on the payload."""

from typing import ClassVar

import numpy as np

from discrepancy.team.causes.base import Cause, stack
from estimator.arrays import Array
from estimator.estimate.fusion import fusion_matrix


class Drag(Cause):
    """Force -c v on the payload at its centre of mass, and a moment -c_r omega.

    With ``powers`` of two in its shape also -q |v| v and -q_r |omega| omega, as air and water resist; both may act.
    """

    title = "drag on the payload"
    family = "dissipation"
    parameters = (
        "coefficient_Ns_per_m", "turning_Nms_per_rad", "quadratic_Ns2_per_m2", "turning_quadratic_Nms2_per_rad2",
    )  # fmt: skip
    # The second: the first at half a metre. A plate of 0.4 m^2 in air is within the first at 0.2 m/s, as a carry has;
    # with squares of speeds goes what is as much at 1 m/s, and at 1 rad/s.
    tolerances = (0.05, 0.01, 0.05, 0.01)
    at = "payload"
    positive: ClassVar = parameters
    clipped: ClassVar = parameters
    separate = "Translation at constant attitude separates drag of the payload from friction of the gimbals."

    def sentence(self, n):
        squares = ""
        if n.values.get("quadratic_Ns2_per_m2") or n.values.get("turning_quadratic_Nms2_per_rad2"):
            squares = (
                f", and with the squares of their speeds by {n('quadratic_Ns2_per_m2', 'N s^2/m^2')} and "
            )
            squares += n("turning_quadratic_Nms2_per_rad2", "N m s^2/rad^2")
        return (
            f"the payload's motion is resisted by {n('coefficient_Ns_per_m', 'N s/m', signed=True)}, its turning by "
            f"{n('turning_Nms_per_rad', 'N m s/rad', signed=True)}{squares}"
        )

    def further(self, shape):
        return [] if shape else [{"powers": 2.0}]

    def columns(self, trial, robot, joint, shape):
        motion = trial.motion
        twist: Array = trial.data.twist.reshape(len(trial.s), -1) @ fusion_matrix(trial.shared.grasps).T
        com = trial.shared.pi[1:4] / trial.shared.pi[0]
        velocity = np.asarray(twist[:, 3:] + np.cross(motion.omega, com), dtype=np.float64)
        still = np.zeros_like(velocity)

        def resisting(velocity: Array, omega: Array) -> Array:
            moment = np.asarray(-np.cross(com, velocity) - omega, dtype=np.float64)
            return trial.of_wrench(-velocity, moment)

        columns = [resisting(velocity, still), resisting(still, motion.omega)]
        if not shape:
            return stack([*columns, *(np.zeros_like(c) for c in columns)])
        return stack(
            [*columns, resisting(_squared(velocity), still), resisting(still, _squared(motion.omega))]
        )


def _squared(v: Array) -> Array:
    """|v| v, shape (Q, 3)."""
    return np.linalg.norm(v, axis=1)[:, None] * v
