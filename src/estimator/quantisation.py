"""Detect rounding steps, rows that a logger repeated, and encoders that hold their value."""

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
"""Number of rows that are judged together."""
# Least share of readings whose effort differs from the one before; below it, efforts count as noise-free.
_LIVE = 0.5
_SIGMAS = 8.0  # excess of runs of equal rows over chance, in standard deviations
_ORDER, _NOISE = 6, 1e-6
"""Order of the differences, and their size, relative to the range, above which they are noise: motion leaves less."""
_EQUAL, _OF = 2, 8  # prior pseudo-counts: 2 of 8 readings equal by chance


class Repeats:
    """Distinguish readings that a logger wrote again from readings that are equal by chance.

    The noise of a measured effort distinguishes them: by chance, readings two apart are equal as often as neighbours
    are. A run of equal rows beyond that chance is one reading. Efforts without noise give no evidence, because a robot
    at rest repeats its readings.
    """

    def __init__(self, efforts: Sequence[int]) -> None:
        """Take the columns that hold measured torques, forces or currents; without any, no row counts as repeated."""
        self._efforts = list(efforts)
        self._last: Array | None = None
        self._readings = self._live = self._differences = 0
        self._noisy = np.zeros(len(self._efforts))

    def of(self, values: Array) -> NDArray[np.bool_]:
        """Return which of the next rows (q, C) repeat the row before; q is a multiple of ``BLOCK`` but at the end."""
        self._look(values)
        blocks = [self._block(values[k : k + BLOCK]) for k in range(0, len(values), BLOCK)]
        return np.concatenate(blocks) if blocks else np.zeros(0, dtype=bool)

    def _look(self, values: Array) -> None:
        """Count the high-order differences of the efforts that are noise."""
        with np.errstate(over="ignore", invalid="ignore"):  # overflow; other checks refuse such values
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
        self._last = values[-1].copy()  # do not keep the large array alive
        readings = values[~same]
        self._readings += len(readings)
        self._live += int(np.any((values != above)[:, self._efforts], axis=1).sum())
        repeats = np.zeros(len(values), dtype=bool)
        smooth = self._differences > 0 and not np.any(self._noisy >= _LIVE * self._differences)
        if not self._efforts or smooth or self._live + 1 < _LIVE * self._readings:
            return repeats
        again = np.all(readings[2:] == readings[:-2], axis=1).sum()
        likeliest = np.sqrt(
            (again + _EQUAL) / (len(readings) + _OF)
        )  # bound on the frequency of the commonest reading
        edges = np.flatnonzero(np.diff(np.concatenate([[False], same, [False]]).astype(int))).reshape(-1, 2)
        lengths = edges[:, 1] - edges[:, 0]
        for least in np.unique(lengths):
            usual = len(readings) * likeliest ** (least + 1)
            if np.sum(lengths >= least) > usual + _SIGMAS * np.sqrt(usual):
                for start, stop in edges[lengths >= least]:
                    repeats[start:stop] = True
                return repeats
        return repeats


_LARGEST_RATIO = 1000.0  # of a difference to the step: larger ones are too inaccurate
_OFF = 0.05  # largest distance from a whole number of steps, in steps
# Two values closer than this share of the largest one are equal: floating-point rounding, a log of ten digits.
_ONE_VALUE = (1e-12, 1e-9)


def quantisation_step(values: Array, levels: int = 8) -> float | None:
    """Return the step of which all values are multiples, up to a common offset; None if there is none.

    Differences of neighbouring values are whole steps, whatever the scale and offset of the values.

    Args:
        values: finite samples, shape (q,).
        levels: fewest distinct values that determine a step; use 2 for a channel that may rest.
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
    """Return the step from the non-zero gaps between neighbouring values."""
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
    """Return the rounding step of a sensor, or 0 if values rarely repeat: rounding then acts as white noise."""
    return 0.0 if len(np.unique(values)) > 0.9 * len(values) else quantisation_step(values, levels=2) or 0.0


LEAST = 3
"""Fewest equal readings of a held span. Derived: distinguishing a jump from a constant speed needs two of three steps.
"""
PERIODS = 2
"""Number of periods over which a held value may change. Derived: a reading taken between two encoder values spreads
the change over two periods."""
MOST = 0.5
"""Share of an angle's readings that repeat others; above it, the encoder counts as slow rather than holding. Chosen.
"""
DIES_CYCLES = 4.0
"""Number of cut-off periods after which the response of the low-pass filter is below 1e-4 of its peak. Derived."""
TYPICAL = 0.8
"""Share of the moving readings that are neither held nor next to held ones. Chosen."""
TYPICAL_SIGMAS = 1.2816
"""Standard deviations that contain this share of a normal distribution. Derived."""
FINEST = 2e-6
"""Step [rad or m] assumed for a reading that is not rounded. Chosen: no encoder has more than 21 bits per turn."""


class Held(NamedTuple):
    """Held readings of one column.

    Attributes:
        spans: pairs (first, last + 1) of held readings.
        nats: log-odds [nat] of a held value against equal readings of a moving joint by chance.
    """

    column: int
    spans: tuple[tuple[int, int], ...]
    nats: float


def held_spans(x: Array, step: float) -> list[tuple[int, int]]:
    """Find spans (first, last + 1) of readings that repeat the one before although the angle moved on.

    An angle that stays within one step for m periods at constant acceleration has a speed of at most 4 / m steps per
    period. It therefore changes by at most (1 + 2 p / m)^2 steps in p periods before or after the span. Before a held
    value, the joint moves faster than this limit. After it, the reading jumps by the whole motion during the span.
    That jump exceeds the limit, and exceeds the change in the next period by more than the limit. If an encoder shows
    this at least once, it holds values. Then every span is held whose change before or after exceeds the limit plus
    the effect of the neighbouring acceleration.

    Args:
        x: readings, shape (Q,).
        step: rounding step, greater than 0.
    """
    edges = np.append(0, np.flatnonzero(np.diff(x)) + 1)
    first, stop = edges[:-1], edges[1:]
    there = (stop - first >= LEAST) & (stop + 3 * PERIODS <= len(x))
    first, stop = first[there], stop[there]

    def changes(p: int) -> tuple[Array, Array, Array, Array, Array]:
        """Return the largest change of a resting joint in p periods, and changes before and after the span."""
        most = step * (0.5 + (1.0 + 2.0 * p / (stop - first - 1.0)) ** 2)  # readings change by whole steps
        before, back, end = np.maximum(first - p, 0), np.maximum(first - 2 * p, 0), stop - 1
        each = ((first, before), (before, back), (end + p, end), (end + 2 * p, end + p))
        into, earlier, out, after = (np.abs(x[b] - x[a]) for a, b in each)
        return most, into, earlier, out, after

    stops, leaves = np.zeros((2, len(first)), dtype=bool)
    for most, into, earlier, out, after in map(changes, range(1, PERIODS + 1)):
        # Extrapolating a change from two differences adds two roundings.
        enters = (2.0 * into - earlier > most + 2.0 * step) & (earlier > most)
        stops, leaves = stops | enters, leaves | (2.0 * out - after > most + 2.0 * step)
    most, into, _, out, after = changes(1)
    if not np.any((into > most) & (out > most + after)):
        return []
    # If the joint also rested before: starting from rest at constant acceleration takes twice as long as at the final
    # speed. That speed shows only some periods later.
    stood = np.abs(x[first] - x[np.maximum(2 * first - stop, 0)]) < 2.5 * step
    moved = np.abs(x[stop - 1 + PERIODS] - x[stop - 1])
    speed = np.abs(x[stop - 1 + 3 * PERIODS] - x[stop - 1 + PERIODS]) / (2.0 * PERIODS)
    late = stop - 2 * PERIODS - np.ceil(2.0 * moved / np.maximum(speed, step / (2.0 * PERIODS))).astype(int)
    first, held = np.where(stood & ~stops, np.maximum(first, late), first), stops | leaves
    # A span includes the first reading of the run and the one after it: a sample between two readings mixes both.
    return [(int(a), int(b) + 1) for a, b in zip(first[held], stop[held], strict=True)]


def scatter(x: Array) -> float:
    """Return the rounding step whose noise matches that of moving readings, shape (Q,), from fourth differences."""
    apart = np.abs(np.diff(x, 4))
    sigma = np.quantile(apart[apart > 0.0], TYPICAL) / TYPICAL_SIGMAS if apart.any() else 0.0
    return float(sigma * np.sqrt(12.0 / 70.0))


def filled(x: Array, steps: Sequence[float] | Array) -> tuple[Array, tuple[Held, ...], Array]:
    """Return readings with held ones interpolated, the held readings, and the doubt of the interpolation.

    The doubt is the difference between cubic and quintic interpolation over the standard deviation of the rounding
    error. It is the largest of all columns at each instant, shape (Q,).

    Args:
        x: readings of C joints, shape (Q, C).
        steps: rounding step of each, 0 for none.
    """
    found, doubt, out = [], np.zeros(len(x)), x
    for column, (own, size) in enumerate(zip(x.T, steps, strict=True)):
        # A fast joint rarely repeats a value of a coarse encoder, and a log of five digits is coarser above 100.
        blocks = (own[k : k + BLOCK] for k in range(0, len(own), BLOCK))
        step = max(size, *(quantisation_step(block) or 0.0 for block in blocks))
        plain = held_spans(own, step or FINEST)
        spans = held_spans(own, max(step, scatter(own))) if step else plain
        step = step or FINEST
        if not spans or sum(b - a for a, b in plain) > MOST * len(own):
            continue
        there = np.zeros(len(own), dtype=bool)
        for start, stop in spans:
            there[start:stop] = True
        # Alternative hypothesis: the reading takes any value along the joint's path.
        nats = sum((b - a) * np.log1p(abs(own[b] - own[a]) / step) for a, b in spans)
        found.append(Held(column, tuple(spans), float(nats)))
        cubic, quintic = (_interpolated(own, there, order) for order in (3, 5))
        doubt = np.maximum(doubt, np.abs(cubic - quintic) / (step / np.sqrt(12.0)))
        out = x.copy() if out is x else out
        out[:, column] = own + step * np.round((quintic - own) / step)
    return out, tuple(found), doubt


def without_held(recording: Recording) -> tuple[Recording, tuple[Held, ...], Array]:
    """Apply ``filled`` to a recording; columns are all driven angles, then all gimbal angles (see ``angle_of``)."""
    angles = np.stack([recording.phi, recording.theta], axis=1)
    x = angles.reshape(len(angles), -1)
    x, held, doubt = filled(x, [rounding_step(own) for own in x.T])
    phi, theta = np.moveaxis(x.reshape(angles.shape), 1, 0)
    return replace(recording, phi=phi, theta=theta) if held else recording, held, doubt


def angle_of(column: int, robots: int) -> tuple[int, int, int]:
    """Return (1 for a gimbal or 0, robot, joint) of a column, all from 0, for a recording of N robots."""
    kind, robot, joint = np.unravel_index(column, (2, robots, 3))
    return int(kind), int(robot), int(joint)


def doubtful(doubt: Array, rate_hz: float, cutoff_hz: float) -> NDArray[np.bool_]:
    """Return a mask (Q,) of filtered samples (angles, rates, accelerations) that held readings change beyond noise.

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
        make_interp_spline,  # slow import, rarely needed
    )

    at, out = np.arange(len(x), dtype=float), x.copy()
    out[missing] = make_interp_spline(at[~missing], x[~missing], order)(at[missing])
    return out
