"""Stretches of an excerpt in which every robot has samples, on one grid: a broken log is looked at where it is whole.

Unlike resampling for an estimate (``mocobot_logs.resample``) nothing is refused: rows that are not finite or go back in
time are left out, gaps split the log, and what is too short is not looked at.
"""

from collections.abc import Sequence

import numpy as np
from scipy.interpolate import make_interp_spline

from estimator.arrays import Array
from estimator.clocks.offsets import ClockEstimate
from mocobot_inspect.signals import RATE_HZ, TRIM_S
from mocobot_inspect.stream.noise import wild
from mocobot_logs.log import NS, Samples

MAX_GAP_S = 0.05
SHORTEST_S = 2 * TRIM_S + 2.0
_PERIODS = 3.5  # a gap in a slow log


def clean_stream(
    samples: Samples, origin_ns: int, faulty: Sequence[tuple[int, int]] = ()
) -> tuple[Array, Array]:
    """One robot's samples, without those that cannot be used; averaged where they come faster than 100 Hz.

    Args:
        samples: the samples.
        origin_ns: the stamp from which time counts [ns].
        faulty: stamps between which samples are not to be used [ns].

    Returns:
        Increasing times [s], shape (q,), and the nine channels, all finite, shape (q, 9).
    """
    time_s = np.asarray((samples.stamp_ns - origin_ns) * NS, dtype=np.float64)
    values = samples.values[:, :9]
    good = np.isfinite(values).all(axis=1) & ~np.apply_along_axis(wild, 0, values).any(axis=1)
    for start_ns, stop_ns in faulty:
        good &= (samples.stamp_ns < start_ns) | (samples.stamp_ns >= stop_ns)
    time_s, values = time_s[good], values[good]
    if not len(time_s):
        return time_s, values
    later = np.concatenate([[True], time_s[1:] > np.maximum.accumulate(time_s)[:-1]])
    time_s, values = time_s[later], values[later]
    if len(time_s) < 2:
        return time_s, values
    k = round(1.0 / float(np.median(np.diff(time_s))) / RATE_HZ)
    if 2 <= k <= len(time_s):
        # Means over the output's period: crude against aliases, but what is looked at ends at 5 Hz.
        starts = np.arange(0, len(time_s) - k + 1, k)
        time_s = np.asarray(np.add.reduceat(time_s[: starts[-1] + k], starts) / k, dtype=np.float64)
        values = np.asarray(np.add.reduceat(values[: starts[-1] + k], starts, axis=0) / k, dtype=np.float64)
    return time_s, values


def stretches(
    streams: Sequence[tuple[Array, Array]], clocks: ClockEstimate | None = None
) -> list[tuple[float, Array]]:
    """Uniform stretches that all robots share.

    Args:
        streams: times [s] and channels of every robot, see ``clean_stream``.
        clocks: offsets and drifts to be taken out, where they are known.

    Returns:
        For each its first instant [s] and samples at ``RATE_HZ``, shape (q, N, 9).
    """
    told = []
    for robot, (time_s, values) in enumerate(streams):
        if clocks is not None and np.isfinite(clocks.offset_s[robot]):
            drift = clocks.drift[robot]
            time_s = clocks.middle_s + (time_s - clocks.middle_s - clocks.offset_s[robot]) / (1.0 + drift)
        told.append((time_s, values))
    shared = [(-np.inf, np.inf)]
    for time_s, _ in told:
        shared = _meet(shared, _whole(time_s))
    found = []
    for start, stop in shared:
        # On the samples of robot 1, so that a log on one grid stays as it is.
        first_time = told[0][0]
        start = float(first_time[np.searchsorted(first_time, start - 1e-7)])
        count = int(np.floor((stop - start) * RATE_HZ + 1e-6)) + 1
        if count < SHORTEST_S * RATE_HZ:
            continue
        grid = start + np.arange(count) / RATE_HZ
        found.append((start, np.stack([_at(time_s, values, grid) for time_s, values in told], axis=1)))
    return found


def _whole(time_s: Array) -> list[tuple[float, float]]:
    """Intervals without gaps."""
    if len(time_s) < 4:
        return []
    steps = np.diff(time_s)
    limit = max(MAX_GAP_S, _PERIODS * float(np.median(steps)))
    edges = np.flatnonzero(steps > limit)
    starts, stops = np.concatenate([[0], edges + 1]), np.concatenate([edges, [len(time_s) - 1]])
    return [(float(time_s[a]), float(time_s[b])) for a, b in zip(starts, stops, strict=True) if b - a >= 4]


def _meet(a: list[tuple[float, float]], b: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Intersection of two lists of intervals, both in order."""
    both, i, j = [], 0, 0
    while i < len(a) and j < len(b):
        start, stop = max(a[i][0], b[j][0]), min(a[i][1], b[j][1])
        if stop > start:
            both.append((start, stop))
        if a[i][1] < b[j][1]:
            i += 1
        else:
            j += 1
    return both


def _at(time_s: Array, values: Array, grid: Array) -> Array:
    low = max(0, int(np.searchsorted(time_s, grid[0])) - 8)
    high = min(len(time_s), int(np.searchsorted(time_s, grid[-1])) + 8)
    spline = make_interp_spline(time_s[low:high], values[low:high], k=3)
    return np.asarray(spline(np.clip(grid, time_s[low], time_s[high - 1])), dtype=np.float64)
