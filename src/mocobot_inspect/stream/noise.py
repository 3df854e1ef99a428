"""Noise level of a channel, from its samples alone."""

import numpy as np

from estimator.arrays import Array

_LAG_GAIN = 70.0  # variance of a fourth difference over that of white noise: 1 + 16 + 36 + 16 + 1
_MAD = 0.6744897501960817  # median of |x| of a standard normal distribution


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
