"""Dry friction while it slides, and when it does not."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from discrepancy.team.noise import SMOOTH_HZ
from estimator.filtering import differentiate, low_pass

Array = NDArray[np.float64]

SHORTEST_REST_S = 0.15
KNOTS_S = 0.5


def sliding(x: Array, rate_hz: float, slow: float) -> tuple[Array, Array]:
    """Direction of motion in [-1, 1] and rate of a displacement x, each of shape (Q,).

    Below the rate ``slow`` the direction fades to zero: at rest friction may have any value up to its limit.
    """
    rate = differentiate(low_pass(x, rate_hz, SMOOTH_HZ), rate_hz)
    return np.clip(rate / slow, -1.0, 1.0), rate


def rests(x: Array, rate_hz: float, slow: float) -> list[Array]:
    """Columns (Q,) of what friction does while it holds: any force that it takes, as it changes with the load.

    Per interval of rest, straight lines between knots at most ``KNOTS_S`` apart.
    """
    still = np.abs(sliding(x, rate_hz, slow)[0]) < 1.0
    edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]]).astype(int))).reshape(-1, 2)
    out = []
    for start, stop in edges:
        if stop - start < SHORTEST_REST_S * rate_hz:
            continue
        pieces = math.ceil((stop - start) / rate_hz / KNOTS_S)
        knots = np.linspace(start, stop - 1, pieces + 1)
        for unit in np.eye(pieces + 1):
            column = np.zeros(len(x))
            column[start:stop] = np.interp(np.arange(start, stop), knots, unit)
            out.append(column)
    return out
