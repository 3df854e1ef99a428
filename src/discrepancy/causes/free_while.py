"""A quantity that may have any value for a while."""

import math

import numpy as np
from numpy.typing import NDArray

from estimator.arrays import Array


def free_while(
    where: NDArray[np.bool_], rate_hz: float, knots_s: float, shortest_s: float = 0.0
) -> list[Array]:
    """Columns (Q,): per interval of ``where`` (Q,), straight lines between knots at most ``knots_s`` apart.

    Intervals shorter than ``shortest_s`` have none.
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], where, [False]]).astype(int))).reshape(-1, 2)
    out = []
    for start, stop in edges:
        if stop - start < shortest_s * rate_hz:
            continue
        pieces = math.ceil((stop - start) / rate_hz / knots_s)
        knots = np.linspace(start, stop - 1, pieces + 1)
        for unit in np.eye(pieces + 1):
            column = np.zeros(len(where))
            column[start:stop] = np.interp(np.arange(start, stop), knots, unit)
            out.append(column)
    return out
