"""What samples tell of their sensor: rounding steps, rows that a logger repeated, encoders that hold their value."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimator.arrays import Array
from estimator.filtering import differentiate, low_pass
from estimator.recording.model import Recording

BLOCK = 1024
"""Rows that are judged together."""
_LIVE = 0.5  # of the readings differ in an effort from the one before, or the efforts have no noise
_SIGMAS = 8.0  # by which runs of equal rows are more than chance makes of them
_ORDER, _NOISE = 6, 1e-6
"""Differences, and their share of the range beyond which they are noise: motion leaves less."""
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
            kept = np.append(True, changes)[: len(values)]
            efforts = values[kept][:, self._efforts]
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
# Share of the largest value by which one may come out as two: in rounding, in a log of ten digits.
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


LEAST = 3
"""Equal readings at least. Derived: two of three steps are needed to tell a jump from a speed."""
PERIODS = 2
"""In which a held value is left. Derived: what is taken between two readings is left in two."""
MOST = 0.5
"""Share of an angle's readings that repeat others, beyond which its encoder is no worse than slow. Chosen."""
DIES_CYCLES = 4.0
"""Periods of its cut-off after which the low-pass filter's response is below 1e-4 of its peak. Derived."""
TYPICAL = 0.8
"""Share of readings that are neither held nor next to such, of those that move. Chosen."""
TYPICAL_SIGMAS = 1.2816
"""Standard deviations that such a share of normal numbers stays within. Derived."""
FINEST = 2e-6
"""Step [rad or m] of a reading that is not rounded. Chosen: no encoder has more than 21 bits a turn."""


class Held(NamedTuple):
    """Readings of a column that were held.

    Attributes:
        spans: readings that are none, first and last but one more.
        nats: by how much a value that is held is likelier than readings of a moving joint that happen to be equal.
    """

    column: int
    spans: tuple[tuple[int, int], ...]
    nats: float


def held_spans(x: Array, step: float) -> list[tuple[int, int]]:
    """Spans of readings that repeat one before them while the angle moved on, first and last but one more.

    An angle that stays within one step for m periods and has one acceleration all the time has a speed of 4 / m steps
    per period at most, so that it changes by (1 + 2 p / m)^2 steps in p periods before or after. A value that is held
    is entered at speed, by more than that, and left by all that the angle moved meanwhile: by more than that, and by as
    much more than in the period after. In an encoder that does so once, any value is held that is entered or left by
    more than that beyond what the change before or after makes of the acceleration.

    Args:
        x: readings, shape (Q,).
        step: rounding step, greater than 0.
    """
    edges = np.append(0, np.flatnonzero(np.diff(x)) + 1)
    first, stop = edges[:-1], edges[1:]
    there = (stop - first >= LEAST) & (stop + 3 * PERIODS <= len(x))
    first, stop = first[there], stop[there]

    def changes(p: int) -> tuple[Array, Array, Array, Array, Array]:
        """The most that a joint at rest changes in p periods, and what it does before the span and after it."""
        most = step * (0.5 + (1.0 + 2.0 * p / (stop - first - 1.0)) ** 2)  # readings change by whole steps
        before, back, end = np.maximum(first - p, 0), np.maximum(first - 2 * p, 0), stop - 1
        each = ((first, before), (before, back), (end + p, end), (end + 2 * p, end + p))
        into, earlier, out, after = (np.abs(x[b] - x[a]) for a, b in each)
        return most, into, earlier, out, after

    stops, leaves = np.zeros((2, len(first)), dtype=bool)
    for most, into, earlier, out, after in map(changes, range(1, PERIODS + 1)):
        # Twice a change less another: two more roundings.
        enters = (2.0 * into - earlier > most + 2.0 * step) & (earlier > most)
        stops, leaves = stops | enters, leaves | (2.0 * out - after > most + 2.0 * step)
    most, into, _, out, after = changes(1)
    if not np.any((into > most) & (out > most + after)):
        return []
    # Where it stood before, too: from rest with one acceleration, it takes twice as long as at the speed at the end,
    # which is seen some periods later only.
    stood = np.abs(x[first] - x[np.maximum(2 * first - stop, 0)]) < 2.5 * step
    moved = np.abs(x[stop - 1 + PERIODS] - x[stop - 1])
    speed = np.abs(x[stop - 1 + 3 * PERIODS] - x[stop - 1 + PERIODS]) / (2.0 * PERIODS)
    late = stop - 2 * PERIODS - np.ceil(2.0 * moved / np.maximum(speed, step / (2.0 * PERIODS))).astype(int)
    first, held = np.where(stood & ~stops, np.maximum(first, late), first), stops | leaves
    # One more at either end: what is taken between two readings has a share of both.
    return [(int(a), int(b) + 1) for a, b in zip(first[held], stop[held], strict=True)]


def scatter(x: Array) -> float:
    """Rounding step that would make the noise of moving readings, shape (Q,), from their fourth differences."""
    apart = np.abs(np.diff(x, 4))
    sigma = np.quantile(apart[apart > 0.0], TYPICAL) / TYPICAL_SIGMAS if apart.any() else 0.0
    return float(sigma * np.sqrt(12.0 / 70.0))


def filled(x: Array, steps: Sequence[float] | Array) -> tuple[Array, tuple[Held, ...], Array]:
    """Readings with held ones interpolated, which these are, and how wrong the interpolation may be.

    The last is the difference between two orders of interpolation over the standard deviation of the reading's
    rounding, the largest of the columns at each instant, shape (Q,).

    Args:
        x: readings of C joints, shape (Q, C).
        steps: rounding step of each, 0 for none.
    """
    found, doubt, out = [], np.zeros(len(x)), x
    for column, (own, size) in enumerate(zip(x.T, steps, strict=True)):
        step = size or FINEST
        plain = held_spans(own, step)
        spans = held_spans(own, max(step, scatter(own))) if size else plain
        if not spans or sum(b - a for a, b in plain) > MOST * len(own):
            continue
        there = np.zeros(len(own), dtype=bool)
        for start, stop in spans:
            there[start:stop] = True
        # Against readings that may have had any value on the joint's way.
        nats = sum((b - a) * np.log1p(abs(own[b] - own[a]) / step) for a, b in spans)
        found.append(Held(column, tuple(spans), float(nats)))
        cubic, quintic = (_interpolated(own, there, order) for order in (3, 5))
        doubt = np.maximum(doubt, np.abs(cubic - quintic) / (step / np.sqrt(12.0)))
        out = x.copy() if out is x else out
        out[:, column] = own + step * np.round((quintic - own) / step)
    return out, tuple(found), doubt


def without_held(recording: Recording) -> tuple[Recording, tuple[Held, ...], Array]:
    """The same of a recording, whose columns are its driven angles, then those of its gimbals (``angle_of``)."""
    angles = np.stack([recording.phi, recording.theta], axis=1)
    x = angles.reshape(len(angles), -1)
    x, held, doubt = filled(x, [rounding_step(own) for own in x.T])
    phi, theta = np.moveaxis(x.reshape(angles.shape), 1, 0)
    return replace(recording, phi=phi, theta=theta) if held else recording, held, doubt


def angle_of(column: int, robots: int) -> tuple[int, int, int]:
    """Whether it is a gimbal's, and its robot and joint, all from 0, of a column of a recording of N robots."""
    kind, robot, joint = np.unravel_index(column, (2, robots, 3))
    return int(kind), int(robot), int(joint)


def doubtful(doubt: Array, rate_hz: float, cutoff_hz: float) -> NDArray[np.bool_]:
    """Samples of filtered angles, rates and accelerations that held readings may change by more than noise, shape (Q,).

    ``doubt`` is that of ``filled``; the filter is ``filtering.low_pass``.
    """
    out = np.zeros(len(doubt), dtype=bool)
    if doubt.any():
        half = round(DIES_CYCLES * rate_hz / cutoff_hz)
        impulse = np.zeros(4 * half + 1)
        impulse[2 * half] = 1.0
        weights = low_pass(impulse, rate_hz, cutoff_hz)
        for _ in range(3):
            most = np.convolve(doubt, np.abs(weights[half : 3 * half + 1]), mode="same")
            out |= most > np.linalg.norm(weights)
            weights = differentiate(weights, rate_hz)
    return out


def _interpolated(x: Array, missing: NDArray[np.bool_], order: int) -> Array:
    from scipy.interpolate import (
        make_interp_spline,  # takes a while to load, and few encoders hold their values
    )

    at, out = np.arange(len(x), dtype=float), x.copy()
    out[missing] = make_interp_spline(at[~missing], x[~missing], order)(at[missing])
    return out
