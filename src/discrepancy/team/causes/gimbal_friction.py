"""Coulomb and viscous friction of a gimbal axis."""

import numpy as np

from discrepancy.team.causes.base import Cause, stack
from discrepancy.team.causes.hysteresis import stop_operator
from discrepancy.team.noise import SMOOTH_HZ
from estimator.filtering import differentiate, low_pass
from estimator.gimbal import rate_matrix


class GimbalFriction(Cause):
    """The gimbal is not quite passive: it turns the payload with a moment about its axis (1, 2, 3 are z, y, x).

    A pure moment is the same wherever it acts, so robots with parallel axes share the blame.
    """

    name = "gimbal_friction"
    family = "dissipation"
    parameters = ("coulomb_Nm", "viscous_Nms_per_rad")
    shapes = ({"width_rad": 5e-4}, {"width_rad": 2e-3}, {"width_rad": 1e-4})
    separate = "Which robot's gimbal rubs shows only with one robot released at a time."

    def columns(self, trial, robot, joint, shape):  # noqa: D102
        rate = trial.signals.rate_hz
        theta = low_pass(trial.signals.theta[:, robot, joint], rate, SMOOTH_HZ)
        axes_T = np.swapaxes(rate_matrix(trial.s[:, robot, 9:12]), -1, -2)
        moment = np.linalg.solve(axes_T, np.tile(np.eye(3)[joint][:, None], (len(theta), 1, 1)))[..., 0]
        moment = moment @ trial.shared.grasps.R_1i[robot].T
        nothing = np.zeros_like(moment)
        # The payload is turned by less than the balance believes: an outside moment of the other sign.
        return stack(
            [
                trial.of_wrench(nothing, -moment * state[:, None])
                for state in (stop_operator(theta, shape["width_rad"]), differentiate(theta, rate))
            ]
        )
