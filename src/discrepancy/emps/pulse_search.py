"""Find rectangular pulses in a residual: when they start, how often they come, how long and how large they are.

A box is fitted to the residual folded at every period (box least squares: Kovacs, Zucker, Mazeh, "A box-fitting
algorithm in the search for periodic transits", A&A 391, 2002), then its edges are read off the samples.

A box and all that is not in it fit equally well but for rounding, and so do boxes that differ by an empty bin. Their
edges are not read off alike, so which of them is taken must not hang on rounding: of equals it is the one of the lowest
frequency, then the narrowest, then the first.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from discrepancy import rules
from estimator.arrays import Array


class Train(NamedTuple):
    """Rectangular pulses from ``start_s`` on: on for ``width_s`` every ``period_s``."""

    start_s: float
    period_s: float
    width_s: float
    size: float


def pulse_train(residual: Array, rate_hz: float) -> Train:
    """The rectangular train that explains most of a residual, shape (Q,); there always is one, meaningful or not."""
    step = max(1, round(rate_hz / rules.PULSE_FOLD_HZ))
    count = len(residual) // step
    coarse = residual[: count * step].reshape(count, step).mean(axis=1)
    time = (np.arange(count) + 0.5) * step / rate_hz
    level = coarse - np.median(coarse)
    duration = count * step / rate_hz
    shortest, longest = rules.PULSE_PERIODS_S
    frequencies = np.arange(1.0 / min(longest, duration / 2.0), 1.0 / shortest, 0.1 / duration)
    best = (-1.0, 1.0, 0.0, 0.5)
    for frequency in frequencies:
        power, phase, width = _box(level, time * frequency % 1.0)
        if power > best[0] * (1.0 + rules.EQUAL_SHARE):
            best = (power, 1.0 / frequency, phase / frequency, width / frequency)
    _, period, start, width = best
    start %= period
    if start + width > period:  # on already when the recording begins
        start -= period
    found = _sharpened(residual, rate_hz, Train(start, period, width, 0.0))
    return _from_zero(residual, rate_hz, found)


def _from_zero(residual: Array, rate_hz: float, train: Train) -> Train:
    """The train, or what is between its pulses if that is further from zero."""
    on = rectangle(np.arange(len(residual)) / rate_hz, *train[:3]) > 0.5
    if not on.any() or on.all():
        return train
    inside, between = abs(np.median(residual[on])), abs(np.median(residual[~on]))
    if inside >= between * (1.0 - rules.EQUAL_SHARE):
        return train
    start, width = train.start_s + train.width_s, train.period_s - train.width_s
    if start > train.period_s or (start - train.period_s + width > 0.0 and start - train.period_s < 0.0):
        start -= train.period_s  # one was on already when the recording began
    return Train(start, train.period_s, width, -train.size)


def rectangle(time: Array, start_s: float, period_s: float, width_s: float) -> Array:
    """1 while a pulse is on, else 0, shape (Q,); nothing before the start."""
    since = time - start_s
    # Stamps are on a grid, and so are edges: what is a rounding error before an edge is on it.
    return ((since > -rules.ON_IT) & ((since + rules.ON_IT) % period_s < width_s)).astype(float)


def _box(level: Array, phase: Array) -> tuple[float, float, float]:
    """The best box in a folded series, of equals the narrowest: power, start and width in shares of the period."""
    bins = _floor(phase * rules.PULSE_BINS) % rules.PULSE_BINS
    sums = np.bincount(bins, level, rules.PULSE_BINS)
    counts = np.bincount(bins, minlength=rules.PULSE_BINS)
    total, number = sums.sum(), counts.sum()
    doubled = np.concatenate([[0.0], np.cumsum(np.tile(sums, 2))])
    many = np.concatenate([[0.0], np.cumsum(np.tile(counts, 2))])
    start = np.arange(rules.PULSE_BINS)
    widths = np.arange(2, rules.PULSE_BINS - 1)
    stop = start + widths[:, None]
    inside, n = doubled[stop] - doubled[start], many[stop] - many[start]
    spread = np.maximum(n * (number - n) / number, 1e-9)
    power = (inside - total * n / number) ** 2 / spread
    first = int(np.argmax(power >= power.max() * (1.0 - rules.EQUAL_SHARE)))
    k, at = np.unravel_index(first, power.shape)
    return float(power[k, at]), at / rules.PULSE_BINS, widths[k] / rules.PULSE_BINS


def _sharpened(residual: Array, rate_hz: float, train: Train) -> Train:
    """Edges to the sample, from where the residual crosses half of the pulses' size; unchanged where they are none."""
    time = np.arange(len(residual)) / rate_hz
    on = rectangle(time + train.period_s, *train[:3]) > 0.5
    low, high = np.median(residual[~on]), np.median(residual[on])
    train = Train(train.start_s, train.period_s, train.width_s, float(high - low))
    above = (residual - low) / (high - low) > 0.5 if high != low else on
    rising, falling = _edges(above, True), _edges(above, False)
    ups, ranks = _matched(time, rising, train.start_s, train.period_s)
    downs, _ = _matched(time, falling, train.start_s + train.width_s, train.period_s)
    expected = int((time[-1] - train.start_s) / train.period_s) + 1
    if len(ups) < max(2, 0.8 * expected) or len(downs) < max(2, 0.8 * expected - 1):
        return train
    period, start = np.polyfit(ranks, ups, 1)
    _, ends = np.polyfit(_matched(time, falling, train.start_s + train.width_s, train.period_s)[1], downs, 1)
    grid = 1.0 / rate_hz
    start, width = _floor(start / grid + 0.5) * grid, _floor((ends - start) / grid + 0.5) * grid
    whole = _floor(period / grid + 0.5)
    # Edges are whole samples, so this is a fraction, and may be one but for rounding.
    if abs(period / grid - whole) * len(ups) < 1.0 - rules.ON_IT:
        period = whole * grid
    return Train(float(start), float(period), float(width), train.size)


def _floor(x: ArrayLike) -> NDArray[np.intp]:
    """The whole numbers below, where what is a rounding error below one counts as it."""
    return np.floor(np.asarray(x) + rules.ON_IT).astype(np.intp)


def _edges(above: NDArray[np.bool_], rising: bool) -> NDArray[np.intp]:
    change = np.diff(above.astype(int))
    return np.flatnonzero(change == (1 if rising else -1)) + 1


def _matched(time: Array, edges: NDArray[np.intp], start: float, period: float) -> tuple[Array, Array]:
    """Times of edges near where they are expected, one each, and their numbers from 0."""
    found, ranks = [], []
    for k in range(int((time[-1] - start) / period) + 1):
        if not len(edges):
            break
        near = edges[np.argmin(np.abs(time[edges] - start - k * period))]
        if abs(time[near] - start - k * period) < 0.1 * period:
            found.append(time[near])
            ranks.append(k)
    return np.array(found), np.array(ranks, dtype=float)
