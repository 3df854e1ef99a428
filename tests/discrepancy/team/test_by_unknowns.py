"""Derivatives of the residual by grasps, payload and bases, against differences of the residual itself."""

from __future__ import annotations

import numpy as np
import pytest

from discrepancy.team.linear.trial_linear import by_bases, by_shared
from estimator.rigid_team.residual import balance, pose_error
from team_case import exact


@pytest.fixture(scope="module")
def case():
    return exact()


@pytest.mark.parametrize("off", [0.0, 1e-3, 0.7])
def test_against_differences(case, off: float) -> None:
    """At closed loops and at some that are open by up to 40 degrees, where a turn is no turn of its logarithm."""
    data, N = case.linear.data, case.linear.robots
    rng = np.random.default_rng(2)
    split = 6 * (N - 1)
    shared = case.shared.moved(off * np.append(rng.uniform(-1.0, 1.0, split), np.zeros(10)))
    bases = case.bases.moved(off * rng.uniform(-1.0, 1.0, 4 * (N - 1)))

    def residual(x, y):
        at, where = shared.moved(x), bases.moved(y)
        pose = pose_error(data.R_bi, data.p_bi, at, where)
        return np.concatenate([pose, balance(data, at)[0]], axis=1)[::50]

    none = np.zeros(split + 10), np.zeros(4 * (N - 1))
    for columns, which in (
        (by_shared(data, shared, bases)[::50], 0),
        (by_bases(data, shared, bases)[::50], 1),
    ):
        for k in range(columns.shape[2]):
            ends = []
            for sign in (1.0, -1.0):
                step = [x.copy() for x in none]
                step[which][k] = sign * 1e-6
                ends.append(residual(*step))
            slope = (ends[0] - ends[1]) / 2e-6
            np.testing.assert_allclose(columns[..., k], slope, rtol=1e-6, atol=1e-6)
