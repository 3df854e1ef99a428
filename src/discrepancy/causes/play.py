"""What a play makes of a signal."""

import numpy as np

from estimator.arrays import Array


def played(x: Array, half_width: float) -> Array:
    """A signal (Q,) behind a play: it stays where it is until the signal is farther off than half the play's width.

    While the signal rises or falls without turning, only where it began matters: from turn to turn, not from sample to
    sample.
    """
    moves = np.flatnonzero(np.diff(x))  # where it does not stand still
    way = np.sign(np.diff(x)[moves])
    turns = moves[1:][way[1:] != way[:-1]]
    ends, at, starts = [*x[turns].tolist(), float(x[-1])], float(x[0]), []
    for end in ends:
        starts.append(at)
        at = min(max(at, end - half_width), end + half_width)
    counts = np.diff([0, *(turns + 1), len(x)])  # a turn ends the run before it
    start = np.repeat(starts, counts)
    return np.clip(start, x - half_width, x + half_width)
