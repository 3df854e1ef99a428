"""What a part that was not searched leaves where robots, payload and causes are as they were found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from discrepancy.team.linear.reduction import Reduction
from estimator.arrays import Array

ODD_CHANCE, ODD_FACTOR = 0.01, 1.5
"""A part is searched, too, where in one of its windows more is left than would be by chance once in a hundred such
diagnoses if windows were normal, and by that factor. Derived: Student's t of the windows that were searched, over all
comparisons; the factor is chosen: what moves otherwise leaves otherwise. Measured: an hour of a random motion, 0.8."""

ODD_WINDOW_S = 10.0
"""Of a part at a time that is held against what was searched. Chosen: a short push, some periods of a motion."""


@dataclass(frozen=True, eq=False)
class Left:
    """Residual of one part, in windows.

    Attributes:
        means: of every channel in every window of motion, shape (w, C).
        rms: about those, shape (w, C).
        holds: mean of every channel in every hold, shape (h, C).
    """

    means: Array
    rms: Array
    holds: Array

    @classmethod
    def of(cls, reduction: Reduction, rows: Array) -> Left:
        """Of rows, shape (n, C), in any unit."""
        moving, time = rows[: reduction.moving], reduction.time[: reduction.moving]
        lasts_s = time[-1] - time[0] if len(time) else 0.0
        count = max(1, int(lasts_s / ODD_WINDOW_S))  # equal ones: none is left over at the end
        window = np.minimum((time - time[:1]) / max(lasts_s, 1e-9) * count, count - 1).astype(int)
        # One that holds leave little of tells little.
        parts = [moving[window == k] for k in np.unique(window)]
        full = max(map(len, parts), default=0)
        parts = [part for part in parts if 2 * len(part) >= full]
        none = np.zeros((0, rows.shape[1]))
        means = np.array([part.mean(axis=0) for part in parts]) if parts else none
        rms = np.array([part.std(axis=0) for part in parts]) if parts else none
        return cls(means, rms, rows[reduction.moving :])


def more_left(others: Mapping[int, Left], searched: Sequence[Left]) -> dict[int, float]:
    """By what factor of what is allowed each part leaves more than what was searched; beyond 1 something else is there.

    What was not there to compare with, holds for one, is not compared.

    Args:
        others: parts by their number.
        searched: parts that were.
    """
    worst = dict.fromkeys(others, 0.0)
    for name in ("means", "rms", "holds"):
        known, each = _of(name, searched), {k: _of(name, [left]) for k, left in others.items()}
        count = sum(x.size for x in each.values())
        if len(known) < 2 or not count:
            continue
        # Means are about nought; how loud windows are, about what they are on average, in shares of it.
        middle = known.mean(axis=0) if name == "rms" else np.zeros(known.shape[1])
        scale = np.sqrt(np.sum((known - middle) ** 2, axis=0) / (len(known) - (name == "rms")))
        allowed = -ODD_FACTOR * stdtrit(len(known) - 1, 0.5 * ODD_CHANCE / count)
        for k, x in each.items():
            away = (x - middle if name == "rms" else np.abs(x)) / np.maximum(scale, 1e-300)
            worst[k] = max(worst[k], float(away.max(initial=0.0) / allowed))
    return worst


def _of(name: str, lefts: Sequence[Left]) -> Array:
    """Of all windows of some parts, shape (w, C)."""
    x = np.concatenate([getattr(left, name) for left in lefts])
    return np.log(np.maximum(x, 1e-300)) if name == "rms" else x


def times_as_much(others: Sequence[Left], searched: Sequence[Left]) -> float | None:
    """How many times as much is left in motion as in what was searched, median of channels; None where all rests."""
    squares = [_of("means", lefts) ** 2 + np.exp(2.0 * _of("rms", lefts)) for lefts in (others, searched)]
    if not all(map(len, squares)):
        return None
    own, known = (np.mean(square, axis=0) for square in squares)
    return float(np.sqrt(np.median(own / np.maximum(known, 1e-300))))
