"""A joint log on an even grid: at its own rate where its stamps are even, else interpolated and low-passed.

The parts between long gaps are logs of their own. What is done to stamps that are not even is what ``resample`` does to
a team's: gaps are bridged by polynomials, a quintic spline leads onto a finer grid, and a known low-pass back to the
log's rate, so that noise of samples a moment apart is averaged and nothing folds.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from estimator.arrays import Array
from estimator.errors import InputError
from mocobot_logs.log import NS, Samples, Stamps, repeated
from mocobot_logs.resample import MOST_MISSING, Screen, beyond_s
from mocobot_logs.resample_filter import (
    TOLERANCE_NS,
    Decimator,
    Grid,
    Interpolator,
    Merger,
    fineness,
    fitted_rows,
)

MAX_GAP_S = 0.05
"""Longest time without samples, beyond one period, that is bridged [s]."""
SHORTEST_S, LEAST_ROWS = 1.0, 32
"""Parts between gaps that are shorter are left out."""
LEAST_HZ, MOST_HZ = 20.0, 20e3
_BLOCK, _SLOW_SHARE, _SLOW = 64, 0.9, (1.1, 1.75)  # intervals; of the blocks; times the usual one
_MANY, _UNEVEN = 2.0, 0.15  # as in resample.stream
_GAP = 1.75  # periods: jitter alone makes no longer intervals
_INSIDE = 0.1  # of a period: nearer to a sample than that, a bridged gap does not show


@dataclass(frozen=True, eq=False)
class Even:
    """A part of a log on an even grid.

    Attributes:
        start_s: of the first sample, after the log's first stamp [s].
        rate_hz: of the grid [Hz].
        values: channels [SI], shape (Q, C).
        usable: False where a gap was bridged, shape (Q,).
        native_hz: rate of the samples [Hz].
        resampled: whether they were interpolated and low-passed.
        raw: samples as they came, shape (q, C).
        notes: what was done, in sentences.
    """

    start_s: float
    rate_hz: float
    values: Array
    usable: NDArray[np.bool_]
    native_hz: float
    resampled: bool
    raw: Array
    notes: tuple[str, ...]


def even_parts(name: str, channels: tuple[str, ...], samples: Samples, rate_hz: float | None) -> list[Even]:
    """Parts of a log between gaps too long to be bridged, each on an even grid.

    Args:
        name: of the log, for messages.
        channels: their names.
        samples: the log's rows.
        rate_hz: rate that is wanted [Hz]; None for the log's own.

    Raises:
        InputError: stamps run back or are too slow or too fast, a value is not finite, a channel has no value in
            more than a tenth of the rows, or no part is long enough.
    """
    _check_values(name, channels, samples.values)
    screen = Screen(name, channels)
    time_ns, values = screen.keep(samples)
    if len(time_ns) < LEAST_ROWS:
        again = f" ({repeated(screen.repeats)})" if screen.repeats else ""
        raise InputError(f"{name}: has {len(time_ns)} samples{again}; at least {LEAST_ROWS} are needed")
    period_ns = _period_ns(np.diff(time_ns))
    native_hz = 1.0 / (period_ns * NS)
    if not LEAST_HZ <= native_hz <= MOST_HZ:
        raise InputError(
            f"{name}: samples come {period_ns * NS:.6g} s apart, at {native_hz:.6g} Hz; {LEAST_HZ:g} to {MOST_HZ:g} Hz "
            "are allowed (is the unit of time right?)"
        )
    if rate_hz is not None and rate_hz > 1.01 * native_hz:
        raise InputError(
            f"{name}: the map's rate_hz is {rate_hz:g}, but the log has {native_hz:.6g} samples a second; it must be "
            "at most that"
        )
    notes = _notes(screen)
    holes = np.flatnonzero(beyond_s(np.diff(time_ns), period_ns) > MAX_GAP_S)
    edges = np.concatenate([[0], holes + 1, [len(time_ns)]])
    parts, lost_s = [], 0.0
    for first, end in pairwise(edges):
        length_s = float(time_ns[end - 1] - time_ns[first]) * NS
        if length_s < SHORTEST_S or end - first < LEAST_ROWS:
            lost_s += length_s
            continue
        parts.append(_even(time_ns[first:end], values[first:end], period_ns, rate_hz))
    if not parts:
        raise InputError(
            f"{name}: no part of it has samples for {SHORTEST_S:g} s without a gap of more than {MAX_GAP_S:g} s"
        )
    if len(holes):
        longest = float(np.diff(time_ns)[holes].max()) * NS
        notes.append(
            f"{len(holes)} gap{'s' * (len(holes) > 1)} of up to {longest:.3g} s cut the log into {len(parts)} part"
            f"{'s' * (len(parts) > 1)}{f'; {lost_s:.3g} s are in none of them' if lost_s else ''}."
        )
    return [replace(part, notes=(*notes, *part.notes)) for part in parts]


def _even(time_ns: Stamps, values: Array, period_ns: float, rate_hz: float | None) -> Even:
    """One part without long gaps."""
    first_ns = int(time_ns[0])
    time_ns = time_ns - first_ns
    found = _own_grid(time_ns, period_ns)
    notes: list[str] = []
    if found is not None:
        spacing_ns, index, rounded = found
        native_hz = _plain(1.0 / (spacing_ns * NS))
        time_ns = np.rint(index * spacing_ns).astype(np.int64)
        if rounded:
            notes.append(
                f"Stamps are rounded to {rounded * NS:.3g} s; samples are taken as even, {spacing_ns * NS:.6g} s apart."
            )
        wanted = native_hz if rate_hz is None else rate_hz
        if abs(native_hz / wanted - round(native_hz / wanted)) < 1e-4:
            k = round(native_hz / wanted)
            grid = Grid(spacing_ns, spacing_ns, fits=True)
            return _finish(first_ns, time_ns, values, grid, k, native_hz / k, native_hz, notes)
        period_ns = spacing_ns
    native_hz = (len(time_ns) - 1) / (float(time_ns[-1]) * NS)
    wanted = rate_hz if rate_hz is not None else float(np.floor(1.0 / (period_ns * NS) + 0.01))
    interval = np.diff(time_ns)
    jitter = float(np.std(interval - np.maximum(np.rint(interval / period_ns), 1.0) * period_ns))
    fitted = found is None and native_hz >= _MANY * wanted and jitter > _UNEVEN * period_ns
    if fitted:
        period_ns = float(np.mean(interval))
    k = fineness(1.0 / (period_ns * NS), wanted, fitted=fitted)
    rows = fitted_rows(native_hz, wanted) if fitted else 0
    grid = Grid(1.0 / (k * wanted) / NS, period_ns, fitted_rows=rows)
    if found is None:
        notes.append(
            f"Stamps are uneven ({interval.min() * NS:.3g} to {interval.max() * NS:.3g} s apart); samples were "
            f"interpolated at {wanted:g} Hz, and nothing above {0.2 * wanted:.3g} Hz is relied on."
        )
    return _finish(first_ns, time_ns, values, grid, k, wanted, native_hz, notes)


def _finish(
    first_ns: int, time_ns: Stamps, values: Array, grid: Grid, k: int, rate_hz: float, native_hz: float,
    notes: list[str],
) -> Even:  # fmt: skip
    raw, kept_ns = values, time_ns
    if not (grid.fits or grid.fitted_rows):
        merger = Merger(grid.period_ns)
        (time_ns, values), (last_ns, last) = merger.push(time_ns, values), merger.finish()
        time_ns, values = np.concatenate([time_ns, last_ns]), np.concatenate([values, last])
    interpolator = Interpolator(grid, float(np.max(np.diff(time_ns))) * NS)
    fine = np.concatenate([*interpolator.push(time_ns, values), interpolator.finish()])
    decimator = Decimator(k)
    out = decimator.push(fine)
    at_ns = (decimator.lead + np.arange(len(out))) / rate_hz / NS
    usable = _between_samples(at_ns, kept_ns, grid.period_ns)
    if not usable.all():
        notes.append(f"{np.sum(~usable)} of {len(out)} samples are bridged gaps and are left out.")
    start_s = (first_ns + float(at_ns[0])) * NS
    return Even(start_s, rate_hz, out, usable, native_hz, not grid.fits or k > 1, raw, tuple(notes))


def _between_samples(at_ns: Array, time_ns: Stamps, period_ns: float) -> NDArray[np.bool_]:
    """Whether instants are not inside a gap."""
    after = np.clip(np.searchsorted(time_ns, at_ns), 1, len(time_ns) - 1)
    left, right = time_ns[after - 1], time_ns[after]
    margin = _INSIDE * period_ns
    inside = (at_ns - left > margin) & (right - at_ns > margin)
    return ~(inside & (right - left > _GAP * period_ns))


def _own_grid(time_ns: Stamps, period_ns: float) -> tuple[float, NDArray[np.int64], float] | None:
    """If stamps are even: spacing [ns], each sample's number, and the step of rounded stamps, 0 for none [ns].

    Stamps rounded to milliseconds or to a tick of a clock are even if no one is further off than the rounding.
    """
    interval = np.diff(time_ns)
    step_ns = float(np.gcd.reduce(interval))
    index = np.concatenate([[0], np.cumsum(np.rint(interval / period_ns))]).astype(np.int64)
    if np.any(np.diff(index) < 1):
        return None
    spacing_ns, offset_ns = period_ns, 0.0
    for _ in range(3):  # a spacing that is a little off loses count over a long log
        spacing_ns, offset_ns = np.polyfit(index.astype(float), time_ns.astype(float), 1)
        again = np.rint((time_ns - offset_ns) / spacing_ns).astype(np.int64)
        again -= again[0]
        if np.array_equal(again, index):
            break
        index = again
    if np.any(np.diff(index) < 1):
        return None
    off_ns = np.abs(time_ns - offset_ns - index * spacing_ns).max()
    coarse = step_ns if step_ns > 2.0 * TOLERANCE_NS and step_ns < 1.01 * period_ns else 0.0
    if off_ns <= TOLERANCE_NS + 0.5:
        return float(spacing_ns), index, 0.0
    if coarse and off_ns <= 0.75 * coarse and coarse < 0.75 * period_ns:
        return float(spacing_ns), index, coarse
    return None


def _period_ns(interval: Stamps) -> float:
    """The usual interval; the slower one where a log's rate changes by less than twice.

    Such a change shows in the mean of many intervals, in which jitter and single gaps do not.
    """
    median = float(np.median(interval))
    blocks = interval[: len(interval) // _BLOCK * _BLOCK].reshape(-1, _BLOCK).mean(axis=1)
    if not len(blocks):
        return median
    slower = float(np.quantile(blocks, _SLOW_SHARE) / np.median(blocks))
    return median * slower if _SLOW[0] < slower < _SLOW[1] else median


def _plain(rate_hz: float) -> float:
    """A rate without what rounding of stamps makes of it."""
    whole = round(rate_hz)
    return float(whole) if abs(rate_hz - whole) < 1e-5 * rate_hz else rate_hz


def _check_values(name: str, channels: tuple[str, ...], values: Array) -> None:
    if not len(values):
        raise InputError(f"{name}: has no samples")
    infinite = np.argwhere(np.isinf(values))
    if len(infinite):
        row, k = infinite[0]
        raise InputError(
            f"{name}: {channels[k]} is {values[row, k]} in row {row}; every value must be finite (a cell may be empty)"
        )
    blank = np.isnan(values).mean(axis=0)
    k = int(np.argmax(blank))
    if blank[k] > MOST_MISSING:
        lost = f"{100 * blank[k]:.3g} % of the rows" if blank[k] < 1 else "any row"
        raise InputError(
            f"{name}: {channels[k]} has no value in {lost}; at most {100 * MOST_MISSING:g} % may lack one (a joint "
            "without such a column says so in the map: CHANNEL = false)"
        )


def _notes(screen: Screen) -> list[str]:
    notes = []
    if screen.duplicates:
        notes.append(f"{screen.duplicates} rows repeat the row before, stamp included, and were dropped.")
    if screen.repeats:
        notes.append(f"{repeated(screen.repeats)}.")
    if screen.blank:
        worst = max(screen.blank_channels, key=lambda channel: screen.blank_channels[channel])
        notes.append(f"{screen.blank} rows lack a value ({worst} first) and count as missing.")
    return notes
