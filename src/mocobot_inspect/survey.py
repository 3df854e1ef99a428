"""Scan a log of any length once: stamps and channels of every robot, and an excerpt for tests that need many
samples."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mocobot_inspect.channels import Channel, ChannelTally, seconds
from mocobot_logs.log import CHANNELS, NS, LogSource, Samples, joined

GAP = 1.5  # length of an interval, in periods, above which samples are missing
_FIRST = 4096  # number of intervals that determine the period
BLOCK_ROWS = 20_000  # number of rows that are analysed together
EXCERPT_S = 600.0
EXCERPT_ROWS = 4_000_000
"""Longest excerpt [s], and its largest number of rows of all robots; of a longer log, the part with most motion is
taken."""
_BIN_S = 10.0


@dataclass
class Timing:
    """Stamps of one robot."""

    samples: int = 0  # rows of the log, without those that repeat the previous reading
    # first_ns, last_ns: first and last stamp in the log's order [ns], None without rows
    first_ns: int | None = None
    last_ns: int | None = None
    rate_hz: float | None = None  # samples per second between gaps [Hz], or None
    # jitter_rms_s, jitter_max_s: deviation of intervals from the period, without gaps [s]
    jitter_rms_s: float = 0.0
    jitter_max_s: float = 0.0
    gaps: int = 0  # number of intervals in which samples are missing
    missing: int = 0  # number of missing samples
    # longest_gap_s, longest_gap_at_s: longest such interval, and its start after the first stamp [s]
    longest_gap_s: float = 0.0
    longest_gap_at_s: float = 0.0
    duplicates: int = 0  # stamps equal to the previous one
    # rows that hold the previous reading again under a later stamp; they do not count as samples
    repeats: int = 0
    backwards: int = 0  # stamps earlier than the previous one
    # farthest_back_s, farthest_back_at_s: largest backward step, and its start after the first stamp [s]
    farthest_back_s: float = 0.0
    farthest_back_at_s: float = 0.0
    # smallest and largest lead of the recorder's time over the stamps [s], or None
    recorder_s: tuple[float, float] | None = None

    @property
    def duration_s(self) -> float:
        """Time from the first to the last stamp [s]."""
        return 0.0 if self.first_ns is None or self.last_ns is None else (self.last_ns - self.first_ns) * NS


class TimingTally:
    """Counts stamps chunk by chunk; memory does not grow with the log."""

    def __init__(self) -> None:
        self._timing = Timing()
        self._period_s: float | None = None
        self._regular, self._regular_s, self._squares = 0, 0.0, 0.0
        self._waiting: list[NDArray] = []  # intervals and their starts, until the period is known

    def add(self, samples: Samples) -> None:
        """Count the stamps of a chunk, and the recorder's times if given."""
        t, stamp_ns = self._timing, samples.stamp_ns
        if not len(stamp_ns):
            return
        t.repeats += int(samples.repeats.sum())
        t.samples += len(stamp_ns)
        if samples.log_ns is not None:
            lead = (samples.log_ns - stamp_ns) * NS
            ends = (*(t.recorder_s or ()), float(lead.min()), float(lead.max()))
            t.recorder_s = (min(ends), max(ends))
        if t.first_ns is None or t.last_ns is None:
            t.first_ns = int(stamp_ns[0])
        else:
            stamp_ns = np.concatenate([[t.last_ns], stamp_ns])
        t.last_ns = int(stamp_ns[-1])
        self._waiting.append(np.stack([np.diff(stamp_ns) * NS, (stamp_ns[:-1] - t.first_ns) * NS]))
        if self._period_s is not None or sum(part.shape[1] for part in self._waiting) >= _FIRST:
            self._settle()

    def _settle(self) -> None:
        """Count the waiting intervals."""
        t = self._timing
        intervals, at = np.concatenate(self._waiting, axis=1) if self._waiting else np.zeros((2, 0))
        self._waiting = []
        forward = intervals > 0
        if self._period_s is None and forward.any():
            self._period_s = float(np.median(intervals[forward]))
        t.duplicates += int(np.sum(intervals == 0))
        t.backwards += int(np.sum(intervals < 0))
        if len(intervals) and -np.min(intervals) > t.farthest_back_s:
            k = int(np.argmin(intervals))
            t.farthest_back_s, t.farthest_back_at_s = -float(intervals[k]), float(at[k])
        if self._period_s is None:
            return
        regular = forward & (intervals <= GAP * self._period_s)
        self._regular += int(np.sum(regular))
        self._regular_s += float(np.sum(intervals[regular]))
        off = intervals[regular] - self._period_s
        self._squares += float(np.sum(off**2))
        t.jitter_max_s = max(t.jitter_max_s, float(np.max(np.abs(off), initial=0.0)))
        gap = intervals > GAP * self._period_s
        if gap.any():
            t.gaps += int(np.sum(gap))
            t.missing += int(np.sum(np.maximum(np.rint(intervals[gap] / self._period_s) - 1, 1)))
            k = int(np.argmax(intervals))
            if intervals[k] > t.longest_gap_s:
                t.longest_gap_s, t.longest_gap_at_s = float(intervals[k]), float(at[k])

    def finish(self) -> Timing:
        self._settle()
        mean_s = self._regular_s / self._regular if self._regular else None
        self._timing.rate_hz = 1.0 / mean_s if mean_s else None
        self._timing.jitter_rms_s = float(np.sqrt(self._squares / max(self._regular, 1)))
        return self._timing


@dataclass(frozen=True, eq=False)
class Survey:
    # timing, channels: per robot
    timing: tuple[Timing, ...]
    channels: tuple[tuple[Channel, ...], ...]
    excerpt: tuple[Samples, ...]  # samples of every robot, of the whole log or of a part
    # start and end of the part after the log's first stamp [s], or None for the whole log
    excerpt_s: tuple[float, float] | None
    whole: tuple[Timing, ...]  # stamps of the samples that lack no value, per robot

    @property
    def origin_ns(self) -> int:
        """First stamp of the log [ns]."""
        return min((t.first_ns for t in self.timing if t.first_ns is not None), default=0)


def survey(source: LogSource, advance: Callable[[int], object] = lambda _: None) -> Survey:
    """Scan a log with bounded memory; a log too long for the excerpt is read twice."""
    robots = [_Robot(source) for _ in range(source.robots)]
    rows = EXCERPT_ROWS // max(source.robots, 1)
    for robot, samples in source.chunks(advance):
        if len(samples.stamp_ns):
            robots[robot].push(samples, rows)
    for robot in robots:
        robot.look()
    timing, whole = (
        tuple(tally.finish() for tally in of) for of in zip(*(r.stamps for r in robots), strict=True)
    )
    channels = tuple(_as_read(robot.channels.finish(), source, i) for i, robot in enumerate(robots))
    kept, bounds_s = [robot.kept for robot in robots], None
    if any(robot.kept is None for robot in robots):
        start_ns, stop_ns, bounds_s = _liveliest(robots, rows)
        kept = [[] for _ in robots]
        for robot, samples in source.chunks(lambda _: None):
            inside = (samples.stamp_ns >= start_ns) & (samples.stamp_ns < stop_ns)
            kept[robot].append(Samples(samples.stamp_ns[inside], samples.values[inside]))
    excerpt = tuple(joined(parts or [], len(source.channels)) for parts in kept)
    return Survey(timing, channels, excerpt, bounds_s, whole)


def _as_read(channels: tuple[Channel, ...], source: LogSource, robot: int) -> tuple[Channel, ...]:
    """Return channels with the rounding steps in a converted recording's metadata, since its samples no longer show
    them."""
    told = None if source.metadata is None else source.metadata.sampling
    if told is None or told[robot].level != source.level:
        return channels
    steps = told[robot].steps
    return tuple(
        replace(channel, step=step) if step > 0 else channel
        for channel, step in zip(channels, (*steps, *[0.0] * (len(channels) - len(steps))), strict=True)
    )


class _Robot:
    """Stream of one robot.

    Attributes:
        channels: statistics of its channels.
        stamps: its stamps, and those of the samples that lack no value.
        kept: samples for the excerpt, None once they are too many.
        first_ns: first stamp, None without samples.
        lively: motion of the gimbal by time bin.
        rows_per_bin: largest number of samples in a bin.
    """

    def __init__(self, source: LogSource) -> None:
        self.channels, self.stamps = ChannelTally(source.channels), (TimingTally(), TimingTally())
        self.kept: list[Samples] | None = []
        self.first_ns: int | None = None
        self.lively: dict[int, float] = {}
        self.rows_per_bin = 0
        self._theta, self._width = CHANNELS[source.level].index("theta_z"), len(source.channels)
        self._waiting: list[Samples] = []
        self._kept_rows = self._waiting_rows = 0

    def push(self, samples: Samples, most_rows: int) -> None:
        """Add at least one sample; the excerpt holds ``most_rows`` at most."""
        if self.first_ns is None:
            self.first_ns = int(samples.stamp_ns[0])
        full = ~np.isnan(samples.values).any(axis=1)
        self.stamps[0].add(samples)
        self.stamps[1].add(Samples(samples.stamp_ns[full], samples.values[full]))
        self._waiting.append(plain := Samples(samples.stamp_ns, samples.values))
        self._waiting_rows += len(plain.stamp_ns)
        if self._waiting_rows >= BLOCK_ROWS:
            self.look()
        if self.kept is not None:
            self.kept.append(plain)
            self._kept_rows += len(plain.stamp_ns)
            span_s = float(seconds(samples.stamp_ns[-1:], self.first_ns)[0])
            if self._kept_rows > most_rows or span_s > EXCERPT_S:
                self.kept = None

    def look(self) -> None:
        block = joined(self._waiting, self._width)
        self._waiting, self._waiting_rows = [], 0
        if not len(block.stamp_ns) or self.first_ns is None:
            return
        time_s = seconds(block.stamp_ns, self.first_ns)
        self.channels.add(time_s, block.values)
        theta = block.values[:, self._theta : self._theta + 3]
        with np.errstate(all="ignore"):
            change = np.nansum(
                np.square(np.diff(np.where(np.isfinite(theta), theta, np.nan), axis=0)), axis=1
            )
        bins, where = np.unique((time_s[1:] // _BIN_S).astype(np.int64), return_inverse=True)
        for k, energy, count in zip(bins, np.bincount(where, change), np.bincount(where), strict=True):
            self.lively[int(k)] = self.lively.get(int(k), 0.0) + float(energy)
            self.rows_per_bin = max(self.rows_per_bin, int(count))


def _liveliest(robots: list[_Robot], most_rows: int) -> tuple[int, int, tuple[float, float]]:
    """Return the stamps between which the gimbals move most [ns], and the same times after the first stamp [s]."""
    origin = min(robot.first_ns for robot in robots if robot.first_ns is not None)
    total: dict[int, float] = {}
    for robot in robots:
        if robot.first_ns is not None:
            shift = round(float(seconds(np.array(robot.first_ns), origin)) / _BIN_S)
            for k, energy in robot.lively.items():
                total[k + shift] = total.get(k + shift, 0.0) + energy
    largest = max(robot.rows_per_bin for robot in robots)
    width = max(1, min(int(EXCERPT_S / _BIN_S), most_rows // max(largest, 1)))
    best = max(sorted(total), key=lambda start: sum(total.get(k, 0.0) for k in range(start, start + width)))
    ends_s = round(best * _BIN_S), round((best + width) * _BIN_S)
    start_ns, stop_ns = (origin + end * 1_000_000_000 for end in ends_s)
    return (
        start_ns,
        stop_ns,
        (float(seconds(np.array(start_ns), origin)), float(seconds(np.array(stop_ns), origin))),
    )
