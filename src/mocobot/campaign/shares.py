"""Shares of counts, with their errors, and how well stated probabilities hold."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.stats import beta

BINS = ((0.0, 0.5), (0.5, 0.7), (0.7, 0.9), (0.9, 0.99), (0.99, 1.0 + 1e-12))
"""Of stated probabilities."""


def interval(hits: int, of: int) -> tuple[float, float]:
    """Exact 95 % interval of a share (Clopper and Pearson, Biometrika 26, 1934)."""
    low = beta.ppf(0.025, hits, of - hits + 1) if hits else 0.0
    high = beta.ppf(0.975, hits + 1, of - hits) if hits < of else 1.0
    return float(low), float(high)


def share(hits: int, of: int) -> dict[str, Any]:
    """Counts and interval of a share, as plain values: {hits, of, interval}."""
    return {"hits": hits, "of": of, "interval": list(interval(hits, of))}


def reliability(stated: Sequence[tuple[float, bool]]) -> dict[str, Any]:
    """How often what was said with a probability was right.

    Args:
        stated: probability and rightness of everything that was named.

    Returns:
        {number, right, brier, bins: [{low, high, mean, right}]}; ``brier`` is the mean square of probability minus
        rightness (Brier, Monthly Weather Review 78, 1950), 0 at best, None where nothing was named; bins that nothing
        falls into are left out.
    """
    bins = []
    for low, high in BINS:
        own = [pair for pair in stated if low <= pair[0] < high]
        if own:
            mean = float(np.mean([p for p, _ in own]))
            bins.append(
                {
                    "low": low,
                    "high": min(high, 1.0),
                    "mean": mean,
                    "right": share(sum(ok for _, ok in own), len(own)),
                }
            )
    return {
        "number": len(stated),
        "right": sum(ok for _, ok in stated),
        "brier": float(np.mean([(p - ok) ** 2 for p, ok in stated])) if stated else None,
        "bins": bins,
    }
