"""Dry friction while it slides, and when it does not."""

import numpy as np

from discrepancy import rules
from discrepancy.causes.free_while import free_while
from discrepancy.emps.recording.signals import Signals
from estimator.arrays import Array

SLOW = tuple({"slow_mps": s} for s in rules.SLOWER_MPS)
"""Speeds below which the direction of friction fades; the first is the catalogue's."""


def direction(signals: Signals, slow: float) -> Array:
    """Direction of motion in [-1, 1], shape (Q,); it fades below the speed ``slow`` [m/s]."""
    return np.clip(signals.v / slow, -1.0, 1.0)


def rests(signals: Signals, slow: float) -> list[Array]:
    """One indicator (Q,) per interval of rest: there friction has an unknown value of its own."""
    still = np.abs(signals.v) < slow
    return free_while(still, signals.log.rate_hz, np.inf, rules.EMPS_SHORTEST_REST_S)
