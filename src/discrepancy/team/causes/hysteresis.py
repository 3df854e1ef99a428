"""The stop operator: what dry friction remembers."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]


@njit(cache=True)
def stop_operator(x: Array, width: float) -> Array:
    """Friction state z in [-1, 1] of a displacement x, shape (Q,): dz = dx / width, clipped.

    It follows the sign of the motion after ``width`` of travel and keeps its value while x rests, as dry friction
    does; the sign of a rate would be lost in noise there.
    """
    z = np.zeros_like(x)
    for t in range(1, len(x)):
        z[t] = min(1.0, max(-1.0, z[t - 1] + (x[t] - x[t - 1]) / width))
    return z
