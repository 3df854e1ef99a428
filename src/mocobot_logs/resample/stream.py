"""One robot's stream, from chunks of rows to samples of the output grid."""

from __future__ import annotations

import numpy as np

from estimator.errors import InputError
from estimator.filtering import MIN_SAMPLES
from estimator.quantisation import rounding_step
from estimator.recording.metadata import SENSORS, Method
from mocobot_logs.log import NS, Array, Samples, Stamps, joined
from mocobot_logs.readings import repeated
from mocobot_logs.resample.fill import Merger
from mocobot_logs.resample.filter import Decimator, fineness
from mocobot_logs.resample.grid import Grid, Interpolator, fitted_rows
from mocobot_logs.resample.report import StreamReport
from mocobot_logs.resample.screen import Screen
from mocobot_logs.resample.tally import MOST_MISSING, Tally, is_hole

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


SLOWEST, FASTEST_HZ = 0.25, 20e3
"""Slowest native rate over the output rate: signals up to 5 Hz need 25 Hz; and the fastest [Hz]."""
PLAUSIBLE_HZ = 5.0
"""Slowest log whose stamps are believed: the rate asked for is blamed, not their unit."""
_TOLERANCE = 0.01  # of the slowest rate, for clocks and jitter
_SAME_RATE = 1e-3
MANY, UNEVEN = 2.0, 0.15
"""Samples that make one of the output, and jitter of intervals over their mean, from which polynomials are fitted."""
_LOOK = 1024  # rows from which the native rate is found


class RobotStream:
    """Resamples a robot's rows as they come.

    Attributes:
        screen: what has passed of the log.
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
        """``robot`` counts from 1; without ``may_fit`` no stamps count as lying on a grid."""
        self._where, self._robot = f"{name}: robot {robot}", robot
        self.screen = Screen(self._where, channels)
        self._channels = channels
        self._rate_hz, self._max_gap_s, self._may_fit = rate_hz, max_gap_s, may_fit
        self._waiting: list[Samples] = []
        self._rows_waiting = 0
        self._head: list[tuple[Stamps, Array]] = []
        self._pipe: _Pipe | None = None
        self._steps = StepFinder()

    @property
    def left_grid(self) -> bool:
        """The samples began on a grid and left it: resample them again, as ones that fit none."""
        return self._pipe is not None and self._pipe.left_grid

    def push(self, samples: Samples) -> None:
        """Take the next rows.

        Raises:
            InputError: see ``resample``.
        """
        self._waiting.append(samples)
        self._rows_waiting += len(samples.stamp_ns)
        if self._rows_waiting >= _LOOK:  # a source may hand out rows one by one
            self._flush()

    def finish(self) -> tuple[int, Array, StreamReport]:
        """Stamp of the first output sample [ns], all output samples (Q, C), and the report.

        Raises:
            InputError: see ``resample``.
        """
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
        return screen.first_ns + round(pipe.lead / self._rate_hz / NS), values, report

    def _flush(self) -> None:
        waiting = self._waiting
        if len({part.log_ns is None for part in waiting}) == 1:  # else single parts tell the recorder's time
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
        """Find the native rate from the first rows, and what to do with all of them."""
        time_ns, values = (np.concatenate(parts) for parts in zip(*self._head, strict=True))
        self._head = []
        grid, k = self._plan(time_ns[:_LOOK])  # the same rows whatever the chunks
        tally = Tally(self._where, grid, self._max_gap_s)
        self._pipe = _Pipe(grid, k, tally, self._max_gap_s)
        self._pipe.push(time_ns, values)
        return self._pipe

    def _plan(self, time_ns: Stamps) -> tuple[Grid, int]:
        """The fine grid, and how many of its samples make one of the output."""
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
        # A logger that is faster than its messages stamps each with the time of its own next row.
        again = self.screen.repeats > 0 and lost > MOST_MISSING * len(time_ns)
        fits = self._may_fit and not again and abs(period_ns / spacing_ns - 1.0) < _SAME_RATE
        if fits and fitting.holds(time_ns):
            return fitting, k
        jitter_ns = interval - np.maximum(np.rint(interval / period_ns), 1.0) * period_ns
        uneven = (
            native_hz >= MANY * self._rate_hz and float(np.sqrt(np.mean(jitter_ns**2))) > UNEVEN * period_ns
        )
        if uneven or again:  # most intervals are shorter than the mean one, and none is told from a gap
            period_ns = float(np.mean(interval[short]))
        native_hz = 1.0 / (period_ns * NS)
        k = fineness(native_hz, self._rate_hz, fitted=uneven)
        rows = fitted_rows(native_hz, self._rate_hz) if uneven else 0
        return Grid(1.0 / (k * self._rate_hz) / NS, period_ns, fitted_rows=rows, uneven=uneven or again), k


class _Pipe:
    """What is done to a stream once its rate is known: count, merge, fill, interpolate, low-pass, thin.

    Attributes:
        tally: gaps and jitter.
        left_grid: as in ``RobotStream``.
    """

    def __init__(self, grid: Grid, k: int, tally: Tally, max_gap_s: float) -> None:
        self.tally = tally
        self.left_grid = False
        self._grid, self._k = grid, k
        self._merger = None if grid.fits or grid.fitted_rows else Merger(grid.period_ns)
        self._interpolator = Interpolator(grid, max_gap_s)
        self._decimator = Decimator(k)
        self._last: Stamps = np.empty(0, np.int64)
        self._out: list[Array] = []

    @property
    def merged(self) -> int:
        return 0 if self._merger is None else self._merger.merged

    @property
    def lead(self) -> int:
        """Output samples before the first one given out."""
        return self._decimator.lead

    @property
    def method(self) -> Method:
        if not self._grid.fits:
            return self._grid.method
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
        """All output samples of ``rows``; none if they left the grid."""
        held = None if self._merger is None else self._merger.finish()
        self.tally.check(rows, self.merged)
        if self.left_grid:
            return np.empty((0, 0))
        if held is not None:
            self._feed(*held)
        self._out.append(self._decimator.push(self._interpolator.finish()))
        values = np.concatenate(self._out)
        self._out = []
        return values

    def _feed(self, time_ns: Stamps, values: Array) -> None:
        self._out += [self._decimator.push(block) for block in self._interpolator.push(time_ns, values)]
