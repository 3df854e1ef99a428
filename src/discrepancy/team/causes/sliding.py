"""Dry friction while it slides, and when it does not."""

from __future__ import annotations

import numpy as np

from discrepancy import rules
from discrepancy.causes.free_while import free_while
from estimator.arrays import Array
from estimator.filtering import differentiate, low_pass


def sliding(x: Array, rate_hz: float, slow: float) -> tuple[Array, Array]:
    """Direction of motion in [-1, 1] and rate of a displacement x, each of shape (Q,).

    Below the rate ``slow`` the direction fades to zero: at rest friction may have any value up to its limit.
    """
    rate = differentiate(low_pass(x, rate_hz, rules.TEAM_SMOOTH_HZ), rate_hz)
    return np.clip(rate / slow, -1.0, 1.0), rate


def rests(x: Array, rate_hz: float, slow: float) -> list[Array]:
    """Columns (Q,) of what friction does while it holds: any force that it takes, as it changes with the load."""
    still = np.abs(sliding(x, rate_hz, slow)[0]) < 1.0
    return free_while(still, rate_hz, rules.REST_KNOTS_S, rules.TEAM_SHORTEST_REST_S)
