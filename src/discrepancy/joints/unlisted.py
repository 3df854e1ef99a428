"""Torques that no cause of the tables makes: smooth functions of one signal of a joint."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np
from scipy.stats import rankdata

from discrepancy.joints.causes import JointSignals
from estimator.arrays import Array

TERMS = 7
"""Cosines of a function: periods down to a quarter of the signal's range."""
SIGNALS: Mapping[str, tuple[Callable[[JointSignals], Array], bool]] = {
    "position": (lambda s: s.q, False),
    "position and direction": (lambda s: s.q, True),
    "speed": (lambda s: np.abs(s.v), True),
    "load": (lambda s: s.load, False),
    "load and direction": (lambda s: s.load, True),
    "time": (lambda s: s.t, False),
}
"""What a function is of, and whether it turns with the direction of motion."""


def functions(signals: Sequence[JointSignals]) -> Iterator[tuple[str, list[list[Array]], Array]]:
    """Bases of smooth functions of one joint.

    Args:
        signals: of the joint, a log each.

    Returns:
        For each signal its name, series (W,) a log of each term, and standard deviations of the terms over that of the
        function, shape (TERMS,): those of a function with a square integrable slope.
    """
    edges = np.cumsum([len(s.q) for s in signals])[:-1]
    for name, (signal, turns) in SIGNALS.items():
        every = np.concatenate([signal(s) for s in signals])
        place = np.split((rankdata(every) - 0.5) / len(every), edges)
        terms = []
        for k in range(TERMS):
            series = [np.cos(np.pi * (k + 1) * u) for u in place]
            terms.append([x * s.direction for x, s in zip(series, signals, strict=True)] if turns else series)
        size = 1.0 / (1.0 + np.arange(TERMS))
        yield name, terms, size / np.sqrt(np.sum(size**2))
