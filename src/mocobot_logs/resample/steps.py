"""The rounding step of a stream's channels, from its samples as they come."""

import numpy as np

from estimator.quantisation import rounding_step
from mocobot_logs.log import Array

ROWS = 1 << 16
"""Rows that are looked at, from the first on: a minute at 1 kHz."""


class StepFinder:
    """Keeps the first rows of a stream."""

    def __init__(self) -> None:
        """Start without any."""
        self._parts: list[Array] = []
        self._rows = 0

    def add(self, values: Array) -> None:
        """Look at the next rows, shape (q, C)."""
        if self._rows < ROWS:
            self._parts.append(values[: ROWS - self._rows].copy())
            self._rows += len(self._parts[-1])

    def steps(self, channels: int) -> tuple[float, ...]:
        """Step of each of the first channels, 0 for none [SI]."""
        values = np.concatenate(self._parts)
        return tuple(rounding_step(values[:, channel]) for channel in range(channels))
