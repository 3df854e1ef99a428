"""Positions that are told within one turn, unwrapped."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from estimator.arrays import Array

TURN = 2.0 * np.pi
LEAST_JUMP = 0.75
"""Of a turn, between two samples, that no joint moves: at 20 Hz it would be 94 rad/s."""
ONE_TURN = 1.01
"""Turns that the readings of an encoder which starts again cover at most."""


def unwrapped(values: Array, names: Sequence[str]) -> tuple[Array, list[str]]:
    """Positions with their jumps by a full turn taken out, and sentences that say so.

    Args:
        values: columns of positions [rad], NaN where a row lacks one, shape (q, C).
        names: of the columns.
    """
    out, notes = values, []
    for c, name in enumerate(names):
        known = np.flatnonzero(np.isfinite(values[:, c]))
        x = values[known, c]
        if not len(x) or np.ptp(x) > ONE_TURN * TURN:
            continue
        jumps = int(np.sum(np.abs(np.diff(x)) > LEAST_JUMP * TURN))
        if jumps:
            out = out.copy() if out is values else out
            out[known, c] = np.unwrap(x)
            times = "once" if jumps == 1 else f"{jumps} times"
            notes.append(
                f"{name} is told within one turn; {times} it jumps by a full turn, which is taken out."
            )
    return out, notes
