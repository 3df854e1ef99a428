"""What a play makes of a signal."""

import numpy as np

from estimator.arrays import Array


def played(x: Array, half_width: float) -> Array:
    """A signal (Q,) behind a play: it stays where it is until the signal is farther off than half the play's width."""
    at, out = float(x[0]), []
    for value in x.tolist():
        at = min(max(at, value - half_width), value + half_width)
        out.append(at)
    return np.array(out)
