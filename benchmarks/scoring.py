"""What campaigns of all machines share: scores of probabilities, and cells of tables."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

SURE = 0.9
"""Probability from which something named and not there is falsely certain."""
LEAST = 1e-3
"""Least probability that a score takes: the engine's own numbers are not good to more."""


def log_score(stated: Sequence[tuple[float, bool]]) -> float:
    """Mean log of the probability that was given to what is so [nats]: 0 at best; nan where nothing was named.

    Args:
        stated: probability of everything that was named, and whether it is there.
    """
    told = [np.clip(p if right else 1.0 - p, LEAST, 1.0) for p, right in stated]
    return float(np.mean(np.log(told))) if told else float("nan")


def median_and_most(values: Iterable[float], digits: int = 1) -> str:
    """Median and largest of seconds or gigabytes, as a cell of a table."""
    each = list(values)
    return f"{np.median(each):.{digits}f}, {max(each):.{digits}f}" if each else "-"
