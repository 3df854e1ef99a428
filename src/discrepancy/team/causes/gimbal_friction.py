"""Coulomb and viscous friction of a gimbal axis."""

import numpy as np

from discrepancy.team.causes.base import Cause
from discrepancy.team.causes.sliding import Friction
from estimator.arm.gimbal import moment_about_axes
from estimator.rigid_team.slots import THETA


class GimbalFriction(Friction):
    """The gimbal is not quite passive: it turns the payload with a moment about its axis (1, 2, 3 are z, y, x).

    A pure moment is the same wherever it acts, so robots with parallel axes share the blame.
    """

    title = "friction in {gimbal axis}"
    at = "gimbal joint"
    moves = "theta"
    separate = "Which robot's gimbal rubs shows only with one robot released at a time."
    undo = Cause.undo  # no sensor reads it

    def direction(self, trial, robot, joint):
        """The payload is turned by less than the balance believes: an outside moment against the axis."""
        moment = moment_about_axes(trial.s[:, robot, THETA], np.eye(3)[joint])
        moment = moment @ trial.shared.grasps.R_1i[robot].T
        return np.concatenate([np.zeros((len(moment), trial.channels - 3)), moment], axis=1)
