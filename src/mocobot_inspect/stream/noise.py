"""Noise level of a channel and samples that are no readings, from the samples alone."""

import numpy as np
from numpy.typing import NDArray

from estimator.arrays import Array

ABSURD = 1e9
"""No angle, length, torque or force in any unit is as large [SI]."""
_FAR = 1000.0  # times what the other samples span, and no less in SI units
_FEW = 0.02  # share of the samples on either side that may be far away

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


def wild(values: Array) -> NDArray[np.bool_]:
    """Samples that no sensor of a robot reads: infinite, absurd, or a thousand times farther away than the others.

    Args:
        values: samples, shape (q,); NaN is not wild.
    """
    with np.errstate(invalid="ignore"):
        absurd = np.abs(values) >= ABSURD
    rest = values[np.isfinite(values) & ~absurd]
    if not len(rest):
        return absurd
    low, middle, high = np.quantile(rest, [_FEW, 0.5, 1.0 - _FEW])
    return absurd | (
        np.abs(np.where(np.isnan(values) | absurd, middle, values) - middle) > _FAR * max(high - low, 1.0)
    )
