"""The step of a quantised channel, from its samples alone."""

import numpy as np

from estimator.arrays import Array

_LARGEST_RATIO = 1000.0  # of a difference to the step: rounding spoils larger ones
_OFF = 0.05  # of a step
# Of the largest value, by which one may come out as two: in rounding, in a log of ten digits.
_ONE_VALUE = (1e-12, 1e-9)


def quantisation_step(values: Array, levels: int = 8) -> float | None:
    """The step that all values are multiples of, up to a common offset; None where there is none.

    Differences of neighbouring values are whole steps, however the values are scaled and shifted.

    Args:
        values: samples, finite, shape (q,).
        levels: fewest different values that tell a step; 2 where a channel at rest may show no more.
    """
    found = np.unique(values)
    if len(found) < levels:
        return None
    gaps, largest = np.diff(found), max(abs(found[0]), abs(found[-1]))
    for share in _ONE_VALUE:
        step = _step_of(gaps[gaps > share * largest], levels)
        if step is not None:
            return step
    return None


def _step_of(gaps: Array, levels: int) -> float | None:
    """The same from the gaps between neighbouring values that differ."""
    if len(gaps) < max(1, levels - 1):
        return None
    step = float(gaps.min())
    step = float(np.median(gaps[gaps < 1.5 * step]))
    ratio = gaps / step
    near = ratio < _LARGEST_RATIO
    whole = np.rint(ratio[near])
    if 2 * len(whole) < len(gaps) or np.max(np.abs(ratio[near] - whole)) > _OFF:
        return None
    return float(np.sum(gaps[near]) / whole.sum())


def rounding_step(values: Array) -> float:
    """Step by which a sensor's errors repeat, or 0: where values hardly repeat, rounding is as good as noise."""
    return 0.0 if len(np.unique(values)) > 0.9 * len(values) else quantisation_step(values, levels=2) or 0.0
