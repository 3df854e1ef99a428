"""Signals at other instants."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline

from estimator.arrays import Array


def advanced(x: Array, rate_hz: float, lead_s: float) -> Array:
    """x(t + lead) of uniform samples, shape (Q, ...); held at the ends."""
    time = np.arange(len(x)) / rate_hz
    return CubicSpline(time, x)(np.clip(time + lead_s, 0.0, time[-1]))
