"""Intervals at which a push may have acted."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from discrepancy import rules
from discrepancy.emps.causes import CAUSES
from discrepancy.rig import Candidate, Parameter, Transient

Array = NDArray[np.float64]


def push(trial: int, start_s: float, duration_s: float, tolerance: float) -> Candidate:
    """A push in one block (index from 0)."""
    cause = CAUSES["push"]
    parameters = (Parameter(cause.parameters[0], tolerance, cause.scales[0]),)
    when = Transient(trial, start_s, duration_s)
    return Candidate("push", cause.family, None, None, parameters, when.shape, when, cause.where)


def worst_intervals(time: Array, residual: Array) -> list[tuple[float, float]]:
    """The intervals (start, duration) [s] in which a constant explains most of a whitened residual, shape (n,)."""
    rate = (len(time) - 1) / (time[-1] - time[0])
    total = np.concatenate([[0.0], np.cumsum(residual - np.median(residual))])
    best = []
    for duration in rules.EMPS_PUSH_S:
        width = max(2, round(duration * rate))
        if width < len(time):
            sums = np.abs(total[width:] - total[:-width]) / np.sqrt(width)
            at = int(np.argmax(sums))
            best.append((float(sums[at]), float(time[at]), duration))
    return [(start, duration) for _, start, duration in sorted(best)[-rules.WORST_INTERVALS :]]


def intervals_near(start_s: float, duration_s: float) -> list[tuple[float, float]]:
    """Intervals whose ends are moved a little."""
    end = start_s + duration_s
    return [
        (start_s + a * duration_s, duration_s + (b - a) * duration_s)
        for a in rules.PUSH_MOVES
        for b in rules.PUSH_MOVES
        if (a or b) and end + b * duration_s - start_s - a * duration_s > rules.EMPS_SHORTEST_PUSH_S
    ]
