"""Torques that no cause of the tables makes: smooth functions of one signal of a joint."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np
from scipy.stats import rankdata

from discrepancy.joints.causes import JointSignals
from estimator.arrays import Array

TERMS = 7
"""Cosines of a function: periods down to a quarter of the signal's range."""
SIGNALS: Mapping[str, tuple[Callable[[JointSignals, JointSignals], Array], bool]] = {
    "position": (lambda s, before: s.q, False),
    "position and direction": (lambda s, before: s.q, True),
    "speed": (lambda s, before: np.abs(s.v), True),
    "load": (lambda s, before: s.load, False),
    "load and direction": (lambda s, before: s.load, True),
    "time": (lambda s, before: s.t, False),
    "neighbour's torque": (lambda s, before: before.asked, False),
    "reading": (lambda s, before: s.q, False),
}
"""What a function is of, and whether it turns with the direction of motion; the last is an error of a position."""
SIZES = 1.0 / (1.0 + np.arange(TERMS)) / np.sqrt(np.sum(1.0 / (1.0 + np.arange(TERMS)) ** 2))
"""Standard deviations of the terms over that of the function: those of a function with a square integrable slope."""


def functions(
    signals: Sequence[JointSignals], before: Sequence[JointSignals]
) -> Iterator[tuple[str, list[list[Array]]]]:
    """Bases of smooth functions of one joint.

    Args:
        signals: of the joint, a log each.
        before: of the joint before it.

    Returns:
        For each signal its name, and series (W,) a log of each term.
    """
    edges = np.cumsum([len(s.q) for s in signals])[:-1]
    for name, (signal, turns) in SIGNALS.items():
        every = np.concatenate([signal(s, b) for s, b in zip(signals, before, strict=True)])
        even = (every - every.min()) / (np.ptp(every) + 1e-9)  # what is differentiated is smooth
        place = np.split(even if name == "reading" else (rankdata(every) - 0.5) / len(every), edges)
        terms = []
        for k in range(TERMS):
            series = [np.cos(np.pi * (k + 1) * u) for u in place]
            if name == "neighbour's torque" and not k:  # a sensor that reads some of it
                series = np.split(every / (np.std(every) + 1e-9), edges)
            terms.append([x * s.direction for x, s in zip(series, signals, strict=True)] if turns else series)
        yield name, terms
