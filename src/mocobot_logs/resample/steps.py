"""The rounding step of a stream's channels, from its samples as they come."""

import numpy as np

from estimator.quantisation import rounding_step
from estimator.recording.sampling import SENSORS
from mocobot_logs.log import Array

BLOCK = 4096
BLOCKS = 16
"""So many blocks of ``BLOCK`` rows are looked at, from the first on: a minute at 1 kHz."""


class StepFinder:
    """Looks at blocks of rows, wherever the pieces end in which they come.

    A block that rests shows no step, and one that moves fast repeats no value; the median of those that tell is taken.
    """

    def __init__(self) -> None:
        """Start without any rows."""
        self._waiting: list[Array] = []
        self._rows = 0
        self._votes: list[list[float]] = []

    def add(self, values: Array) -> None:
        """Look at the next rows, shape (q, C)."""
        while len(values) and len(self._votes) < BLOCKS:
            part, values = np.split(values[:, :SENSORS], [BLOCK - self._rows])
            self._waiting.append(part.copy())  # the piece that it is cut from may be large
            self._rows += len(part)
            if self._rows == BLOCK:
                self._vote()

    def steps(self) -> tuple[float, ...]:
        """Step of each of the sensors' channels, 0 for none [SI]."""
        if self._waiting:
            self._vote()
        told = [[step for step in votes if step > 0] for votes in zip(*self._votes, strict=True)]
        return tuple(float(np.median(steps)) if steps else 0.0 for steps in told)

    def _vote(self) -> None:
        values = np.concatenate(self._waiting)
        self._votes.append([rounding_step(channel) for channel in values.T])
        self._waiting, self._rows = [], 0
