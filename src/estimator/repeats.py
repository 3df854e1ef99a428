"""Rows that repeat the one before: one reading, however often a logger wrote it."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from estimator.arrays import Array

BLOCK = 1024
"""Rows that are judged together."""
_LIVE = 0.5  # of the readings differ in an effort from the one before, or the efforts have no noise
_SIGMAS = 8.0  # by which runs of equal rows are more than chance makes of them
_ORDER, _NOISE = (
    6,
    1e-6,
)  # differences, and their share of the range beyond which they are noise: motion leaves less
_EQUAL, _OF = 2, 8  # readings that are taken to be equal by chance, before any is seen


class Repeats:
    """Tells readings that a logger wrote again from readings that happen to be equal.

    The noise of a measured effort tells: by chance, readings two apart are equal as often as neighbours are. Runs of
    equal rows beyond that are one reading each. Efforts without noise tell nothing: a robot at rest repeats itself.
    """

    def __init__(self, efforts: Sequence[int]) -> None:
        """Take the channels that hold measured torques, forces or currents; without any, no row is a repeated one."""
        self._efforts = list(efforts)
        self._last: Array | None = None
        self._readings = self._live = self._differences = 0
        self._noisy = np.zeros(len(self._efforts))

    def of(self, values: Array) -> NDArray[np.bool_]:
        """Which of the next rows (q, C) repeat the row before; q a multiple of ``BLOCK``, but for the last rows."""
        self._look(values)
        blocks = [self._block(values[k : k + BLOCK]) for k in range(0, len(values), BLOCK)]
        return np.concatenate(blocks) if blocks else np.zeros(0, dtype=bool)

    def _look(self, values: Array) -> None:
        """Count high differences of the efforts that are noise; smooth efforts tell nothing of equal rows."""
        changes = np.any(np.diff(values, axis=0) != 0, axis=1)
        efforts = (
            values[np.append(True, changes)][:, self._efforts] if len(values) else values[:, self._efforts]
        )
        high = np.abs(np.diff(efforts, n=_ORDER, axis=0))
        if high.size:
            self._noisy += np.sum(high > _NOISE * np.ptp(efforts, axis=0), axis=0)
            self._differences += len(high)

    def _block(self, values: Array) -> NDArray[np.bool_]:
        above = np.concatenate([values[:1] if self._last is None else self._last[None], values[:-1]])
        same = np.all(values == above, axis=1)
        same[0] &= self._last is not None
        self._last = values[-1].copy()  # what it is cut from may be large
        readings = values[~same]
        self._readings += len(readings)
        self._live += int(np.any((values != above)[:, self._efforts], axis=1).sum())
        repeats = np.zeros(len(values), dtype=bool)
        smooth = self._differences > 0 and not np.any(self._noisy >= _LIVE * self._differences)
        if not self._efforts or smooth or self._live + 1 < _LIVE * self._readings:
            return repeats
        again = np.all(readings[2:] == readings[:-2], axis=1).sum()
        likeliest = np.sqrt((again + _EQUAL) / (len(readings) + _OF))  # no reading comes more often
        edges = np.flatnonzero(np.diff(np.concatenate([[False], same, [False]]).astype(int))).reshape(-1, 2)
        lengths = edges[:, 1] - edges[:, 0]
        for least in np.unique(lengths):
            usual = len(readings) * likeliest ** (least + 1)
            if np.sum(lengths >= least) > usual + _SIGMAS * np.sqrt(usual):
                for start, stop in edges[lengths >= least]:
                    repeats[start:stop] = True
                return repeats
        return repeats
