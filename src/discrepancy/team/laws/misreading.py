"""A sensor that errs by what there is, not by what it reads: a law of the very signal that is read."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from discrepancy import rules
from estimator.arrays import Array


@dataclass(frozen=True, eq=False)
class Misreading:
    """One reading, and a law of it.

    Attributes:
        read: what is read, shape (Q,).
        values: the law's terms of what there is, shape (Q,) -> (Q, k): one amplitude each.
    """

    read: Array
    values: Callable[[Array], Array]

    def true(self, amplitudes: Array) -> Array:
        """What there is: the reading less its error there, by Newton's method.

        Where an error grows as fast as the truth falls there is no one answer, and the last one is returned.
        """
        true, last = self.read - self.values(self.read) @ amplitudes, np.inf
        for _ in range(rules.LAW_READING_ROUNDS):
            miss = true + self.values(true) @ amplitudes - self.read
            way = float(np.abs(miss).max())
            if way >= last:
                break
            true, last = true - miss / self._rate(true, amplitudes), way
        return true

    def slopes(self, amplitudes: Array) -> Array:
        """By how much the error grows with every amplitude, the reading given, shape (Q, k)."""
        true = self.true(amplitudes)
        return self.values(true) / self._rate(true, amplitudes)[:, None]

    def _rate(self, true: Array, amplitudes: Array) -> Array:
        """Growth of the reading with the truth, 1 for a sensor that does not err."""
        step = rules.LAW_READING_STEP * max(float(np.std(true)), 1e-12)
        rise = (self.values(true + step) - self.values(true - step)) @ amplitudes
        return np.maximum(1.0 + rise / (2.0 * step), rules.LAW_READING_LEAST)
