"""Quantisation step and noise level of a channel, from its samples alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_FEWEST = 8  # different values
_LARGEST_RATIO = 1000.0  # of a difference to the step: rounding spoils larger ones
_OFF = 0.05  # of a step
_LAG_GAIN = 70.0  # variance of a fourth difference over that of white noise: 1 + 16 + 36 + 16 + 1
_MAD = 0.6744897501960817  # median of |x| of a standard normal distribution


def quantisation_step(values: Array) -> float | None:
    """The step that all values are multiples of, up to a common offset; None where there is none.

    Differences of neighbouring values are whole steps, however the values are scaled and shifted.

    Args:
        values: samples, finite, shape (q,).
    """
    levels = np.unique(values)
    if len(levels) < _FEWEST:
        return None
    gaps = np.diff(levels)
    # One value may come out as two that differ in rounding.
    gaps = gaps[gaps > 1e-12 * max(abs(levels[0]), abs(levels[-1]))]
    if len(gaps) < _FEWEST - 1:
        return None
    step = float(gaps.min())
    step = float(np.median(gaps[gaps < 1.5 * step]))
    ratio = gaps / step
    ratio = ratio[ratio < _LARGEST_RATIO]
    if 2 * len(ratio) < len(gaps) or np.max(np.abs(ratio - np.rint(ratio))) > _OFF:
        return None
    whole = np.rint(ratio)
    return float(np.sum(gaps[gaps / step < _LARGEST_RATIO]) / whole.sum())


def noise_level(values: Array) -> float:
    """Standard deviation of white noise on a smooth signal: fourth differences, by their median.

    Noise well below the quantisation step shows as 0.

    Args:
        values: samples in order, finite, shape (q,).
    """
    if len(values) < 5:
        return 0.0
    fourth = np.diff(values, 4)
    return float(np.median(np.abs(fourth)) / _MAD / np.sqrt(_LAG_GAIN))
