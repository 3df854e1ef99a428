"""Intervals at which a push may have acted."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from discrepancy.rig import Candidate, Parameter, Transient
from discrepancy.team.causes import CAUSES
from discrepancy.team.tolerances import DEFAULTS

Array = NDArray[np.float64]

DURATIONS_S = (0.4, 0.8, 1.6, 3.2, 6.4)
WORST = 2


def push(trial: int, start_s: float, duration_s: float, tolerances: Mapping[str, float]) -> Candidate:
    """A push in one trial (index from 0)."""
    cause = CAUSES["push"]
    scales = DEFAULTS["push"]
    parameters = tuple(Parameter(n, tolerances.get(n, 0.0), scales[n]) for n in cause.parameters)
    when = Transient(trial, start_s, duration_s)
    return Candidate("push", cause.family, None, None, parameters, when.shape, when)


def worst_intervals(time: Array, square: Array) -> list[tuple[float, float]]:
    """The intervals (start, duration) [s] with the largest sum of squares over its noise.

    Args:
        time: of the rows [s], shape (n,), evenly spaced but for gaps.
        square: squared whitened residual of every row, shape (n,).
    """
    if len(time) < 3:
        return []
    total = np.concatenate([[0.0], np.cumsum(square - np.median(square))])
    rate = (len(time) - 1) / (time[-1] - time[0])
    best = []
    for duration in DURATIONS_S:
        width = max(2, round(duration * rate))
        if width < len(time):
            sums = (total[width:] - total[:-width]) / np.sqrt(width)
            at = int(np.argmax(sums))
            best.append((float(sums[at]), float(time[at]), duration))
    return [(start, duration) for _, start, duration in sorted(best)[-WORST:]]


def intervals_near(start_s: float, duration_s: float) -> list[tuple[float, float]]:
    end = start_s + duration_s
    steps = np.array([-0.4, -0.2, -0.1, -0.05, 0.0, 0.05, 0.1, 0.2, 0.4]) * duration_s
    return [
        (start_s + a, end + b - start_s - a)
        for a in steps
        for b in steps
        if (a or b) and end + b - start_s - a > 0.1
    ]
