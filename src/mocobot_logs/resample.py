"""Resample a measured log onto uniform grids: one grid per robot, based on its own stamps, all at one rate.

The stamps of a stream decide its method, which the report names:

- *untouched*: every stamp lies within 1 us of the grid that begins at the robot's first stamp. The samples are copied
  bit for bit, so a round trip of a recording changes nothing.
- *filtered*: the stamps lie on a grid k times as fine. An FIR low-pass is applied and every k-th sample is kept.
- *fitted*: the samples are many and uneven. Local polynomials are fitted to the nearest samples, then low-passed and
  decimated by k.
- *interpolated*: any other stream. A quintic spline leads onto a finer grid, then a low-pass and decimation by k.

Missing samples are interpolated first, except in fitted streams. ``resample_filter`` holds the numerical constants.
The low-pass costs a tenth of a second at each end.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimator.errors import InputError
from estimator.filtering import MIN_SAMPLES
from estimator.quantisation import rounding_step
from estimator.recording.metadata import SENSORS, Method, RecordingMetadata
from mocobot_logs.log import NS, Array, Level, LogSource, Samples, Stamps, joined, repeated, rows_of
from mocobot_logs.resample_filter import Decimator, Grid, Interpolator, Merger, fineness, fitted_rows

RATE_HZ = 100.0
MAX_GAP_S = 0.08
"""Longest time without samples, beyond one period, that is filled [s]: four consecutive lost samples at 50 Hz.

Measured: filled samples are off by 7 urad and 5 mN m rms in random trials (0.4 urad and 0.04 mN m in periodic ones).
With 0.12 s the errors are 48 urad and 15 mN m.
"""
MOST_MISSING = 0.1
"""Largest allowed share of missing samples; the same limit holds for samples that come too close together."""
LONGEST_S = 1e8
"""Longest plausible step between stamps [s], three years. Longer steps mean two clocks, and nanoseconds would
overflow."""
LARGEST = 1e100
"""Largest plausible value. Larger ones are no measurements, and arithmetic with them would overflow."""
SLOWEST, FASTEST_HZ = 0.25, 20e3
"""Slowest native rate as a share of the output rate (signals up to 5 Hz need 25 Hz), and the fastest native rate
[Hz]."""
PLAUSIBLE_HZ = 5.0
"""Slowest native rate [Hz] at which an error blames the requested rate. Below it, the error blames the unit of time."""
MANY, UNEVEN = 2.0, 0.15
"""Thresholds for fitting polynomials: native samples per output sample, and rms jitter over the usual interval."""
STEP_ROWS, STEP_BLOCKS = 4096, 16
"""Rows per block and largest number of blocks in which rounding steps are searched: a minute at 1 kHz."""
_STAMP_S = 1e-6  # resolution of gap lengths
_TOLERANCE = 0.01  # relative margin of the slowest rate, for clock errors and jitter
_SAME_RATE = 1e-3
_LOOK = 1024  # number of first rows that determine the native rate


@dataclass(frozen=True)
class StreamReport:
    """Properties of one robot's stream, and how it was resampled."""

    robot: int  # number of the robot, from 1
    samples: int  # rows in the log, including duplicates and repeats
    # first_ns, last_ns: first and last stamp [ns]
    first_ns: int
    last_ns: int
    native_hz: float  # sample rate of the log [Hz], missing samples included
    # jitter_rms_s, jitter_max_s: deviation of intervals from whole periods [s]
    jitter_rms_s: float
    jitter_max_s: float
    gaps: int  # number of intervals in which samples are missing
    longest_gap_s: float  # longest time without samples, beyond one period [s]
    filled: int  # missing samples that were interpolated, at the native rate
    blank: int  # rows dropped because a channel is NaN; they count as missing samples
    blank_channels: dict[str, int]  # number of NaN rows by channel
    duplicates: int  # rows dropped because they equal the previous row in stamp and values
    # rows dropped because they hold the previous reading again under a later stamp. They count as missing samples if
    # the native rate is that of the rows.
    repeats: int
    merged: int  # rows closer than a quarter of a period to the previous row; averaged with it
    method: Method  # resampling method, see the module
    steps: tuple[float, ...]  # rounding step of each sensor channel, 0 for none [SI]

    @property
    def filled_share(self) -> float:
        """Share of missing samples among all expected samples."""
        return self.filled / max(1, self.filled + self.samples - self.blank - self.duplicates - self.repeats)

    def to_dict(self) -> dict[str, Any]:
        return asdict(self) | {"filled_share": self.filled_share}


@dataclass(frozen=True, eq=False)
class Resampled:
    """A log on one uniform grid per robot."""

    # name, level, channels, metadata: as in ``LogSource``
    name: str
    level: Level
    channels: tuple[str, ...]
    metadata: RecordingMetadata | None
    rate_hz: float  # rate of all grids [Hz]
    origin_ns: int  # earliest stamp of the log [ns]
    start_s: Array  # first grid instant of each robot after the origin, by the robot's stamps [s], shape (N,)
    values: tuple[Array, ...]  # samples [SI] of each robot, N arrays of shape (Q_i, C)
    reports: tuple[StreamReport, ...]  # one report per robot, N entries

    @property
    def robots(self) -> int:
        return len(self.values)


def resample(
    source: LogSource,
    rate_hz: float = RATE_HZ,
    max_gap_s: float = MAX_GAP_S,
    advance: Callable[[int], object] = lambda _: None,
) -> Resampled:
    """Resample a log onto uniform grids in chunks; only the output stays in memory.

    The source is read a second time if a robot's stamps leave the grid that fits its first 1024 rows. Refused are
    robots that share no time, fewer than 16 samples, an unsuitable rate, values that are not finite, decreasing stamps,
    two values at one stamp, gaps of more than ``max_gap_s`` beyond one period [s], and more than 10 % missing or
    crowded samples.
    """
    streams: dict[int, RobotStream] = {}
    done: dict[int, tuple[int, Array, StreamReport]] = {}
    for may_fit in (True, False):
        again = [robot for robot in range(source.robots) if robot not in done]
        if not again:
            break
        for robot in again:
            streams[robot] = RobotStream(
                source.name, robot + 1, source.channels, rate_hz, max_gap_s, may_fit=may_fit
            )
        for robot, samples in source.chunks(advance if may_fit else lambda _: None):
            if robot not in done:
                streams[robot].push(samples)
        for robot in again:
            result = streams[robot].finish()
            if not streams[robot].left_grid:
                done[robot] = result
    _check_common_time(source.name, [streams[robot].screen for robot in range(source.robots)])
    starts_ns, values, reports = zip(*(done[robot] for robot in range(source.robots)), strict=True)
    origin_ns = min(report.first_ns for report in reports)
    return Resampled(
        name=source.name,
        level=source.level,
        channels=source.channels,
        metadata=source.metadata,
        rate_hz=rate_hz,
        origin_ns=origin_ns,
        start_s=np.array([(start - origin_ns) * NS for start in starts_ns]),
        values=values,
        reports=reports,
    )


def _check_common_time(name: str, screens: list[Screen]) -> None:
    """Refuse robots whose stamps share no time: their clocks have different epochs."""
    spans = [(s.first_ns or 0, s.last_ns or 0) for s in screens]
    late = max(range(len(spans)), key=lambda i: spans[i][0])
    early = min(range(len(spans)), key=lambda i: spans[i][1])
    if spans[late][0] < spans[early][1]:
        return
    hint = ""
    logs = [s.log_ns for s in screens if s.log_ns is not None]
    if len(logs) == len(screens) and max(a for a, _ in logs) < min(b for _, b in logs):
        hint = ", or use the recorder's time, which they share (clock = \"log\" in the map's [time])"
    words = " and ".join(
        f"robot {i + 1} has {spans[i][0] * NS:.3f} to {spans[i][1] * NS:.3f} s" for i in sorted((early, late))
    )
    raise InputError(f"{name}: {words}, no time in common; all stamps must come from one clock{hint}")


def beyond_s(interval_ns: Stamps, period_ns: float) -> Array:
    """Return the time beyond one period of each interval that lacks samples [s], 0 for the others."""
    return np.where(np.rint(interval_ns / period_ns) > 1, (interval_ns - period_ns) * NS, 0.0)


def is_hole(interval_ns: Stamps, period_ns: float, max_gap_s: float) -> NDArray[np.bool_]:
    """Return whether each interval between stamps is too long to be filled."""
    return beyond_s(interval_ns, period_ns) > max_gap_s + _STAMP_S


class RobotStream:
    """Resamples one robot's rows chunk by chunk.

    Attributes:
        screen: checks and counts of the rows so far.
    """

    def __init__(
        self,
        name: str,
        robot: int,
        channels: tuple[str, ...],
        rate_hz: float,
        max_gap_s: float,
        *,
        may_fit: bool = True,
    ) -> None:
        """``robot`` counts from 1; with ``may_fit`` False the stamps never count as lying on a grid."""
        self._where, self._robot, self._channels = f"{name}: robot {robot}", robot, channels
        self.screen = Screen(self._where, channels)
        self._rate_hz, self._max_gap_s, self._may_fit = rate_hz, max_gap_s, may_fit
        self._waiting: list[Samples] = []
        self._rows_waiting = 0
        self._head: list[tuple[Stamps, Array]] = []
        self._pipe: _Pipe | None = None
        self._steps = _StepFinder()

    @property
    def left_grid(self) -> bool:
        """Whether the stamps began on a grid and left it. The stream must then be resampled with ``may_fit`` False."""
        return self._pipe is not None and self._pipe.left_grid

    def push(self, samples: Samples) -> None:
        self._waiting.append(samples)
        self._rows_waiting += len(samples.stamp_ns)
        if self._rows_waiting >= _LOOK:  # a source may yield single rows
            self._flush()

    def finish(self) -> tuple[int, Array, StreamReport]:
        """Return the stamp of the first output sample [ns], all output samples (Q, C) and the report."""
        self._flush()
        screen = self.screen
        rows = screen.rows - screen.duplicates - screen.blank - screen.repeats
        if screen.first_ns is None or screen.last_ns is None or rows < MIN_SAMPLES:
            blank = f" ({screen.blank} rows lack a value)" if screen.blank else ""
            blank += f" ({repeated(screen.repeats)})" if screen.repeats else ""
            raise InputError(f"{self._where} has {rows} samples{blank}; at least {MIN_SAMPLES} are needed")
        pipe = self._pipe or self._begin()
        values = pipe.finish(rows)
        span_s = (screen.last_ns - screen.first_ns) * NS
        if len(values) < MIN_SAMPLES and not pipe.left_grid:
            raise InputError(
                f"{self._where} has {span_s:.3g} s of samples, which leaves {len(values)} at "
                f"{self._rate_hz:g} Hz; at least {MIN_SAMPLES} are needed"
            )
        tally = pipe.tally
        report = StreamReport(
            robot=self._robot,
            samples=screen.rows,
            first_ns=screen.first_ns,
            last_ns=screen.last_ns,
            native_hz=(rows - pipe.merged + tally.filled - 1) / span_s,
            jitter_rms_s=tally.jitter_rms_s,
            jitter_max_s=tally.jitter_max_s,
            gaps=tally.gaps,
            longest_gap_s=tally.longest_gap_s,
            filled=tally.filled,
            blank=screen.blank,
            blank_channels=dict(screen.blank_channels),
            duplicates=screen.duplicates,
            repeats=screen.repeats,
            merged=pipe.merged,
            method=pipe.method,
            steps=self._steps.steps(),
        )
        return screen.first_ns + round(pipe.decimator.lead / self._rate_hz / NS), values, report

    def _flush(self) -> None:
        waiting = self._waiting
        if len({part.log_ns is None for part in waiting}) == 1:  # else only some parts have log_ns
            waiting = [joined(waiting, len(self._channels))]
        for samples in waiting:
            rows = self.screen.keep(samples)
            self._steps.add(rows[1])
            if self._pipe is not None:
                self._pipe.push(*rows)
                continue
            self._head.append(rows)
            if sum(len(time_ns) for time_ns, _ in self._head) >= _LOOK:
                self._begin()
        self._waiting, self._rows_waiting = [], 0

    def _begin(self) -> _Pipe:
        """Determine the native rate from the first rows and set up the processing."""
        time_ns, values = (np.concatenate(parts) for parts in zip(*self._head, strict=True))
        self._head = []
        grid, k = self._plan(time_ns[:_LOOK])  # a fixed number of rows, independent of the chunks
        self._pipe = _Pipe(grid, k, _Tally(self._where, grid, self._max_gap_s), self._max_gap_s)
        self._pipe.push(time_ns, values)
        return self._pipe

    def _plan(self, time_ns: Stamps) -> tuple[Grid, int]:
        """Return the fine grid and the number of its samples per output sample."""
        period_ns = float(np.median(np.diff(time_ns)))
        native_hz, slowest_hz = 1.0 / (period_ns * NS), SLOWEST * self._rate_hz
        if not slowest_hz * (1.0 - _TOLERANCE) <= native_hz <= FASTEST_HZ:
            asked = PLAUSIBLE_HZ <= native_hz < slowest_hz
            hint = (
                f"; for a recording of {self._rate_hz:g} Hz {slowest_hz:g} to {FASTEST_HZ:g} Hz are needed, "
                f"so this log allows a rate of at most {native_hz / SLOWEST:.4g} Hz"
                if asked
                else f"; {slowest_hz:g} to {FASTEST_HZ:g} Hz are allowed (is the unit of time right?)"
            )
            raise InputError(
                f"{self._where}: samples come {period_ns * NS:.6g} s apart, at {native_hz:.6g} Hz{hint}"
            )
        k = max(1, round(native_hz / self._rate_hz))
        spacing_ns = 1.0 / (k * self._rate_hz) / NS
        fitting = Grid(spacing_ns, spacing_ns, fits=True)
        interval = np.diff(time_ns)
        short = ~is_hole(interval, period_ns, self._max_gap_s)
        lost = np.sum(np.rint(interval[short] / period_ns)) - np.sum(short)
        # A logger faster than its messages stamps each message with the time of its own next row.
        again = self.screen.repeats > 0 and lost > MOST_MISSING * len(time_ns)
        fits = self._may_fit and not again and abs(period_ns / spacing_ns - 1.0) < _SAME_RATE
        if fits and fitting.holds(time_ns):
            return fitting, k
        jitter_ns = interval - np.maximum(np.rint(interval / period_ns), 1.0) * period_ns
        rms_ns = float(np.sqrt(np.mean(jitter_ns**2)))
        uneven = native_hz >= MANY * self._rate_hz and rms_ns > UNEVEN * period_ns
        if uneven or again:  # most intervals are shorter than the mean, and no gap can be identified
            period_ns = float(np.mean(interval[short]))
        native_hz = 1.0 / (period_ns * NS)
        k = fineness(native_hz, self._rate_hz, fitted=uneven)
        rows = fitted_rows(native_hz, self._rate_hz) if uneven else 0
        return Grid(1.0 / (k * self._rate_hz) / NS, period_ns, fitted_rows=rows, uneven=uneven or again), k


class Screen:
    """Drops repeated rows and rows that lack a value, and refuses rows that resampling cannot handle.

    Attributes:
        rows: number of rows seen.
        repeats: rows that hold the previous reading again under a later stamp; they count as missing samples.
        duplicates: rows dropped because they equal the previous row in stamp and values.
        blank: rows dropped because a channel is NaN; they count as missing samples.
        blank_channels: number of NaN rows by channel.
        first_ns, last_ns: first and last stamp [ns], None before the first row.
        log_ns: first and last time of the recorder [ns], None if the log has none.
    """

    def __init__(self, where: str, channels: tuple[str, ...]) -> None:
        """``where`` names the log (and robot) in error messages, ``channels`` the channels."""
        self.rows = self.repeats = self.duplicates = self.blank = 0
        self.blank_channels: Counter[str] = Counter()
        self.first_ns: int | None = None
        self.last_ns: int | None = None
        self.log_ns: tuple[int, int] | None = None
        self._where, self._channels = where, channels
        self._last: Array | None = None

    def keep(self, samples: Samples) -> tuple[Stamps, Array]:
        """Return the new rows of a chunk: time since the first row [ns], shape (q,), and values (q, C)."""
        lacking = np.isnan(samples.values)
        whole = np.flatnonzero(~lacking.any(axis=1))
        left_out = int(samples.repeats.sum())
        row = (self.rows + np.arange(len(lacking)) + np.cumsum(samples.repeats) - samples.repeats)[whole]
        self.rows += len(lacking) + left_out
        self.repeats += left_out
        self.blank += len(lacking) - len(row)
        for k in np.flatnonzero(lacking.any(axis=0)):
            self.blank_channels[self._channels[k]] += int(lacking[:, k].sum())
        if not len(row):
            return samples.stamp_ns[:0], samples.values[:0]
        if len(row) < len(lacking):
            samples = rows_of(samples, whole)
        stamp, values = samples.stamp_ns, samples.values
        first_ns = self.first_ns = int(stamp[0]) if self.first_ns is None else self.first_ns
        if samples.log_ns is not None:
            first = int(samples.log_ns[0]) if self.log_ns is None else self.log_ns[0]
            self.log_ns = first, int(samples.log_ns[-1])
        before = np.concatenate([[stamp[0] if self.last_ns is None else self.last_ns], stamp[:-1]])
        above = np.concatenate([(values[0] if self._last is None else self._last)[None], values[:-1]])
        same = stamp == before
        same[0] &= self._last is not None
        repeats = same & np.all(values == above, axis=1)
        # Differences of floats do not overflow; differences of integer nanoseconds may.
        leaps = np.abs(stamp.astype(float) - before.astype(float)) > LONGEST_S / NS
        bad = ~_is_number(values).all(axis=1) | (stamp < before) | (same & ~repeats) | leaps
        if bad.any():
            k = int(np.argmax(bad))
            here = f"row {row[k]}, {_seconds(int(stamp[k]) - first_ns)} s after its first sample"
            self._refuse(here, int(stamp[k]) - int(before[k]), values[k], above[k])
        self.duplicates += int(repeats.sum())
        self.last_ns, self._last = int(stamp[-1]), values[-1]
        return stamp[~repeats] - first_ns, values[~repeats]

    def _refuse(self, here: str, step_ns: int, values: Array, above: Array) -> None:
        faulty = np.flatnonzero(~_is_number(values))
        if len(faulty):
            raise InputError(
                f"{self._where}: {self._channels[faulty[0]]} is {values[faulty[0]]} in {here}; "
                f"every value must be a finite number, smaller than {LARGEST:g} (convert --drop leaves samples out)"
            )
        if step_ns < 0:
            raise InputError(
                f"{self._where}: time runs back by {_seconds(-step_ns)} s in {here}; stamps must increase"
            )
        if step_ns == 0:
            c = int(np.flatnonzero(values != above)[0])
            raise InputError(
                f"{self._where}: {self._channels[c]} is {above[c]:.9g} and {values[c]:.9g} at one time, "
                f"in {here}; a repeated stamp must repeat all values (are the stamps too coarse?)"
            )
        raise InputError(
            f"{self._where}: time leaps by {_seconds(step_ns)} s in {here}; all stamps of a robot must come from one "
            "clock"
        )


def _is_number(values: Array) -> NDArray[np.bool_]:
    return np.abs(values) < LARGEST  # false for NaN


def _seconds(ns: int) -> str:
    return f"{ns * NS:.9g}"


class _Tally:
    """Statistics of the intervals between stamps: gaps, filled, longest_gap_s and jitter_max_s as in ``StreamReport``.

    If samples are many and uneven, intervals do not reveal missing samples; then none counts as missing.
    """

    def __init__(self, where: str, grid: Grid, max_gap_s: float) -> None:
        self.gaps = self.filled = 0
        self.longest_gap_s = self.jitter_max_s = 0.0
        self._where, self._max_gap_s = where, max_gap_s
        self._period_ns, self._uneven = grid.period_ns, grid.uneven
        self._intervals, self._squares, self._span_ns = 0, 0.0, 0

    @property
    def jitter_rms_s(self) -> float:
        return float(np.sqrt(self._squares / max(1, self._intervals)))

    def add(self, time_ns: Stamps) -> None:
        """Count the intervals between consecutive times [ns] after the first stamp; refuse an interval that is too
        long."""
        interval = np.diff(time_ns)
        if not len(interval):
            return
        periods = np.maximum(np.rint(interval / self._period_ns), 1.0)
        if self._uneven:
            periods[:] = 1.0
        bad = np.flatnonzero(is_hole(interval, self._period_ns, self._max_gap_s))
        if len(bad):
            raise InputError(
                f"{self._where}: no samples for {interval[bad[0]] * NS:.6g} s, from "
                f"{time_ns[bad[0]] * NS:.9g} s after its first sample on; they usually come "
                f"{self._period_ns * NS:.6g} s apart, and at most {self._max_gap_s:g} s more may pass; "
                "rows with NaN or that repeat the one before count as missing (convert --split-at-gaps makes "
                "trials of the parts between gaps, --crop keeps one part)"
            )
        jitter_s = (interval - periods * self._period_ns) * NS
        self._intervals += len(interval)
        self._span_ns += int(np.sum(interval))
        self.filled += int(np.sum(periods - 1))
        self.gaps += int(np.sum(periods > 1))
        longest = np.max(np.where(periods > 1, beyond_s(interval, self._period_ns), 0.0))
        self.longest_gap_s = max(self.longest_gap_s, float(longest))
        self._squares += float(np.sum(jitter_s**2))
        self.jitter_max_s = max(self.jitter_max_s, float(np.max(np.abs(jitter_s))))

    def check(self, rows: int, merged: int) -> None:
        """Refuse a stream of ``rows`` if too many are missing, or too many were ``merged`` with the previous row."""
        # Jitter lengthens and shortens intervals equally often. The total count of rows falls only if samples are
        # lost.
        missing = min(self.filled, round(self._span_ns / self._period_ns) + 1 - rows)
        expected = rows + missing
        if missing > MOST_MISSING * expected:
            raise InputError(
                f"{self._where}: {missing} of {expected} samples are missing "
                f"({100 * missing / expected:.3g} %); at most {100 * MOST_MISSING:g} % may be "
                "(convert --crop keeps a part of the log)"
            )
        if merged > MOST_MISSING * rows:
            raise InputError(
                f"{self._where}: {merged} of {rows} samples come within a quarter of the usual "
                f"{self._period_ns * NS:.6g} s of the one before; at most {100 * MOST_MISSING:g} % may "
                "(does the rate change, or do stamps tell when messages arrived?)"
            )


class _Pipe:
    """Processes a stream once its rate is known: count, merge, fill, interpolate, low-pass, decimate."""

    def __init__(self, grid: Grid, k: int, tally: _Tally, max_gap_s: float) -> None:
        self.tally, self.decimator, self.left_grid = tally, Decimator(k), False
        self._grid, self._k = grid, k
        self._merger = None if grid.fits or grid.fitted_rows else Merger(grid.period_ns)
        self._interpolator = Interpolator(grid, max_gap_s)
        self._last: Stamps = np.empty(0, np.int64)
        self._out: list[Array] = []

    @property
    def merged(self) -> int:
        return 0 if self._merger is None else self._merger.merged

    @property
    def method(self) -> Method:
        if not self._grid.fits:
            return "fitted" if self._grid.fitted_rows else "interpolated"
        return "untouched" if self._k == 1 else "filtered"

    def push(self, time_ns: Stamps, values: Array) -> None:
        after_last = np.concatenate([self._last, time_ns])
        self._last = after_last[-1:]
        self.tally.add(after_last)
        self.left_grid |= self._grid.fits and not self._grid.holds(after_last)
        if self._merger is not None:
            time_ns, values = self._merger.push(time_ns, values)
        if not self.left_grid:
            self._feed(time_ns, values)

    def finish(self, rows: int) -> Array:
        """Return all output samples of a stream of ``rows``; none if the stamps left the grid."""
        held = None if self._merger is None else self._merger.finish()
        self.tally.check(rows, self.merged)
        if self.left_grid:
            return np.empty((0, 0))
        if held is not None:
            self._feed(*held)
        self._out.append(self.decimator.push(self._interpolator.finish()))
        values, self._out = np.concatenate(self._out), []
        return values

    def _feed(self, time_ns: Stamps, values: Array) -> None:
        self._out += [self.decimator.push(block) for block in self._interpolator.push(time_ns, values)]


class _StepFinder:
    """Finds the rounding step of each sensor channel from blocks of fixed length, independent of the chunks.

    A block at rest shows no step, and a block of fast motion repeats no value. The median of the found steps counts.
    """

    def __init__(self) -> None:
        self._waiting: list[Array] = []
        self._rows = 0
        self._votes: list[list[float]] = []

    def add(self, values: Array) -> None:
        """Add the next rows, shape (q, C)."""
        while len(values) and len(self._votes) < STEP_BLOCKS:
            part, values = np.split(values[:, :SENSORS], [STEP_ROWS - self._rows])
            self._waiting.append(part.copy())  # a view would keep the whole chunk in memory
            self._rows += len(part)
            if self._rows == STEP_ROWS:
                self._vote()

    def steps(self) -> tuple[float, ...]:
        """Return the step of each sensor channel, 0 for none [SI]."""
        if self._waiting:
            self._vote()
        told = [[step for step in votes if step > 0] for votes in zip(*self._votes, strict=True)]
        return tuple(float(np.median(steps)) if steps else 0.0 for steps in told)

    def _vote(self) -> None:
        values = np.concatenate(self._waiting)
        self._votes.append([rounding_step(channel) for channel in values.T])
        self._waiting, self._rows = [], 0
