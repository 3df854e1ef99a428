"""Coulomb and viscous friction of a gimbal axis."""

import numpy as np

from discrepancy.team.causes.base import Cause, stack
from discrepancy.team.causes.sliding import rests, sliding
from discrepancy.team.linear.slots import THETA
from estimator.arm.gimbal import rate_matrix


class GimbalFriction(Cause):
    """The gimbal is not quite passive: it turns the payload with a moment about its axis (1, 2, 3 are z, y, x).

    A pure moment is the same wherever it acts, so robots with parallel axes share the blame.
    """

    name = "gimbal_friction"
    family = "dissipation"
    parameters = ("coulomb_Nm", "viscous_Nms_per_rad")
    tolerances = (2e-3, 2e-3)
    clipped = ("coulomb_Nm", "viscous_Nms_per_rad")
    at = "gimbal joint"
    shapes = ({"slow_rad_per_s": 1e-3}, {"slow_rad_per_s": 4e-3})
    positive = ("coulomb_Nm",)
    separate = "Which robot's gimbal rubs shows only with one robot released at a time."

    def sentence(self, n):
        return (
            f"the {self.at} rubs with {n('coulomb_Nm', 'N m')} (Coulomb, while it moves) and "
            f"{n('viscous_Nms_per_rad', 'N m s/rad')} (viscous)"
        )

    def columns(self, trial, robot, joint, shape):
        rate = trial.signals.rate_hz
        states = sliding(trial.signals.theta[:, robot, joint], rate, shape["slow_rad_per_s"])
        return stack([_moment(trial, robot, joint, state) for state in states])

    def unknowns(self, trial, robot, joint, shape):
        theta, rate = trial.signals.theta[:, robot, joint], trial.signals.rate_hz
        return [_moment(trial, robot, joint, rest) for rest in rests(theta, rate, shape["slow_rad_per_s"])]


def _moment(trial, robot, joint, torque):
    """The payload is turned by less than the balance believes: an outside moment against the axis."""
    axes_T = np.swapaxes(rate_matrix(trial.s[:, robot, THETA]), -1, -2)
    moment = np.linalg.solve(axes_T, np.tile(np.eye(3)[joint][:, None], (len(torque), 1, 1)))[..., 0]
    moment = moment @ trial.shared.grasps.R_1i[robot].T
    return trial.of_wrench(np.zeros_like(moment), -moment * torque[:, None])
