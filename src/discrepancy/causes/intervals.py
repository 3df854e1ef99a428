"""Intervals at which an event may have acted."""

from collections.abc import Sequence

import numpy as np

from discrepancy import rules
from discrepancy.candidate import Transient
from estimator.arrays import Array


def worst_intervals(
    trial: int, time: Array, x: Array, durations_s: Sequence[float], *, two_sided: bool
) -> list[Transient]:
    """The intervals with the largest sum of a series over its noise.

    Args:
        trial: index of the trial, from 0.
        time: of the rows [s], shape (n,), evenly spaced but for gaps.
        x: such as the square of a whitened residual, shape (n,).
        durations_s: lengths that are tried [s].
        two_sided: whether a sum far below zero counts as one far above.
    """
    if len(time) < 3:
        return []
    total = np.concatenate([[0.0], np.cumsum(x - np.median(x))])
    rate = (len(time) - 1) / (time[-1] - time[0])
    best = []
    for duration in durations_s:
        width = max(2, round(duration * rate))
        if width < len(time):
            sums = (total[width:] - total[:-width]) / np.sqrt(width)
            sums = np.abs(sums) if two_sided else sums
            at = int(np.argmax(sums))
            best.append((float(sums[at]), float(time[at]), duration))
    return [
        Transient(trial, start, duration) for _, start, duration in sorted(best)[-rules.WORST_INTERVALS :]
    ]
