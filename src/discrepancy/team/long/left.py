"""What a part that was not searched leaves where robots, payload and causes are as they were found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from discrepancy import rules
from discrepancy.team.linear.reduction import Reduction
from estimator.arrays import Array


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
        window = np.floor((time - time[0]) / rules.ODD_WINDOW_S) if len(time) else time
        # One that holds and ends leave little of tells little.
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
        allowed = rules.ODD_FACTOR * -stdtrit(len(known) - 1, 0.5 * rules.ODD_CHANCE / count)
        for k, x in each.items():
            away = (x - middle if name == "rms" else np.abs(x)) / np.maximum(scale, 1e-300)
            worst[k] = max(worst[k], float(away.max(initial=0.0) / allowed))
    return worst


def _of(name: str, lefts: Sequence[Left]) -> Array:
    """Of all windows of some parts, shape (w, C)."""
    x = np.concatenate([getattr(left, name) for left in lefts])
    return np.log(np.maximum(x, 1e-300)) if name == "rms" else x


def typical(lefts: Sequence[Left]) -> Array:
    """Mean square of every channel in motion, shape (C,)."""
    means, rms = (np.concatenate([getattr(left, name) for left in lefts]) for name in ("means", "rms"))
    return np.asarray(np.mean(means**2 + rms**2, axis=0)) if len(means) else np.zeros(means.shape[1])
