"""Errors of single sensors that last as long as a push, and would look like it."""

from collections.abc import Sequence

import numpy as np

from discrepancy.candidate import Candidate
from discrepancy.least_squares.whitening import Whitening
from discrepancy.team.causes.base import one_joint
from discrepancy.team.causes.push import during
from discrepancy.team.linear.trial_linear import TrialLinear
from estimator.arrays import Array


def wrong_torques(
    linear: Sequence[TrialLinear], whitening: Sequence[Whitening], push: Candidate
) -> list[list[Array]]:
    """Every joint's torque in turn, wrong by 1 N m while a push lasts: whitened columns (n, C, 1) per trial."""
    if push.transient is None:
        return []
    at = push.transient.trial
    window = during(linear[at], push.shape)
    none = [np.zeros((*trial.residual.shape, 1)) for trial in linear]
    found = []
    for robot in range(linear[at].robots):
        for joint in range(3):
            wrong = linear[at].of_signals(robot, tau=one_joint(window, joint))
            found.append([*none[:at], whitening[at](wrong[..., None]), *none[at + 1 :]])
    return found
