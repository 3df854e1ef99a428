"""Signals at other instants."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

Array = NDArray[np.float64]


def advanced(x: Array, rate_hz: float, lead_s: float) -> Array:
    """x(t + lead) of uniform samples, shape (Q, ...); held at the ends."""
    time = np.arange(len(x)) / rate_hz
    return CubicSpline(time, x)(np.clip(time + lead_s, 0.0, time[-1]))
