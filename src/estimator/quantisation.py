"""The step of a quantised channel, from its samples alone."""

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
        with np.errstate(over="ignore", invalid="ignore"):  # of values beyond floats, which others refuse
            changes = np.any(np.diff(values, axis=0) != 0, axis=1)
            efforts = (
                values[np.append(True, changes)][:, self._efforts]
                if len(values)
                else values[:, self._efforts]
            )
            high = np.abs(np.diff(efforts, n=_ORDER, axis=0))
            noisy = high > _NOISE * np.ptp(efforts, axis=0) if high.size else high
        if high.size:
            self._noisy += np.sum(noisy, axis=0)
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


_LARGEST_RATIO = 1000.0  # of a difference to the step: rounding spoils larger ones
_OFF = 0.05  # of a step
# Of the largest value, by which one may come out as two: in rounding, in a log of ten digits.
_ONE_VALUE = (1e-12, 1e-9)


def quantisation_step(values: Array, levels: int = 8) -> float | None:
    """The step that all values are multiples of, up to a common offset; None where there is none.

    Differences of neighbouring values are whole steps, however the values are scaled and shifted.

    Args:
        values: samples, finite, shape (q,).
        levels: fewest different values that tell a step; 2 where a channel at rest may show no more.
    """
    found = np.unique(values)
    if len(found) < levels:
        return None
    gaps, largest = np.diff(found), max(abs(found[0]), abs(found[-1]))
    for share in _ONE_VALUE:
        step = _step_of(gaps[gaps > share * largest], levels)
        if step is not None:
            return step
    return None


def _step_of(gaps: Array, levels: int) -> float | None:
    """The same from the gaps between neighbouring values that differ."""
    if len(gaps) < max(1, levels - 1):
        return None
    step = float(gaps.min())
    step = float(np.median(gaps[gaps < 1.5 * step]))
    ratio = gaps / step
    near = ratio < _LARGEST_RATIO
    whole = np.rint(ratio[near])
    if 2 * len(whole) < len(gaps) or np.max(np.abs(ratio[near] - whole)) > _OFF:
        return None
    return float(np.sum(gaps[near]) / whole.sum())


def rounding_step(values: Array) -> float:
    """Step by which a sensor's errors repeat, or 0: where values hardly repeat, rounding is as good as noise."""
    return 0.0 if len(np.unique(values)) > 0.9 * len(values) else quantisation_step(values, levels=2) or 0.0
