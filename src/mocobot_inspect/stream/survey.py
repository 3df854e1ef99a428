"""One pass over a log of any length: counts of everything, and an excerpt for what needs many samples at once."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from estimator.arrays import Array
from mocobot_inspect.stream.channels import Channel, ChannelTally, seconds
from mocobot_inspect.stream.timing import Timing, TimingTally
from mocobot_logs.log import CHANNELS, LogSource, Samples, joined

BLOCK_ROWS = 20_000
"""Rows looked at together."""
EXCERPT_S = 600.0
EXCERPT_ROWS = 4_000_000
"""Longest excerpt, in time and in rows of all robots; a longer log is looked at in its liveliest part."""
_BIN_S = 10.0


@dataclass(frozen=True, eq=False)
class Survey:
    """What a log holds.

    Attributes:
        timing, channels: per robot.
        whole: stamps of the samples that lack no value, per robot.
        excerpt: samples of every robot, those of the whole log or of a part.
        excerpt_s: beginning and end of the part after the log's first stamp [s], or None for the whole log.
    """

    timing: tuple[Timing, ...]
    channels: tuple[tuple[Channel, ...], ...]
    excerpt: tuple[Samples, ...]
    excerpt_s: tuple[float, float] | None
    whole: tuple[Timing, ...]

    @property
    def origin_ns(self) -> int:
        """The log's first stamp [ns]."""
        return min((t.first_ns for t in self.timing if t.first_ns is not None), default=0)


def survey(source: LogSource, advance: Callable[[int], object] = lambda _: None) -> Survey:
    """Read a log; memory is bounded by blocks and the excerpt.

    A log too long for the excerpt is read twice.

    Raises:
        InputError: the log cannot be read.
    """
    robots = [_Robot(source) for _ in range(source.robots)]
    rows = EXCERPT_ROWS // max(source.robots, 1)
    for robot, samples in source.chunks(advance):
        robots[robot].push(samples, rows)
    timing, whole = tuple(robot.finish() for robot in robots), tuple(robot.whole.finish() for robot in robots)
    channels = tuple(_as_read(robot.channels.finish(), source, i) for i, robot in enumerate(robots))
    if all(robot.complete for robot in robots):
        return Survey(timing, channels, tuple(robot.excerpt() for robot in robots), None, whole)
    for robot in robots:
        robot.kept.clear()
    start_ns, stop_ns = _liveliest(robots, rows)
    parts: list[list[Samples]] = [[] for _ in robots]
    for robot, samples in source.chunks(lambda _: None):
        inside = (samples.stamp_ns >= start_ns) & (samples.stamp_ns < stop_ns)
        if inside.any():
            parts[robot].append(Samples(samples.stamp_ns[inside], samples.values[inside]))
    origin = min(robot.first_ns for robot in robots if robot.first_ns is not None)
    bounds = float(seconds(np.array(start_ns), origin)), float(seconds(np.array(stop_ns), origin))
    return Survey(timing, channels, tuple(joined(p, len(source.channels)) for p in parts), bounds, whole)


def _as_read(channels: tuple[Channel, ...], source: LogSource, robot: int) -> tuple[Channel, ...]:
    """Channels with the steps that a converted recording tells of, as its samples show none any more."""
    told = None if source.metadata is None else source.metadata.sampling
    if told is None or told[robot].level != source.level:
        return channels
    steps = told[robot].steps
    return tuple(
        replace(channel, step=step) if step > 0 else channel
        for channel, step in zip(channels, (*steps, *[0.0] * (len(channels) - len(steps))), strict=True)
    )


class _Robot:
    """One robot's stream."""

    def __init__(self, source: LogSource) -> None:
        self.channels = ChannelTally(source.channels)
        self.kept: list[Samples] = []
        self.complete, self.first_ns = True, None
        self.lively: dict[int, float] = {}  # motion of the gimbal by time bin
        self.rows_per_bin = 0
        self._names, self._timing, self.whole = source.channels, TimingTally(), TimingTally()
        self._theta = CHANNELS[source.level].index("theta_z")
        self._waiting: list[Samples] = []
        self._kept_rows = self._waiting_rows = 0
        self.first_ns: int | None

    def push(self, samples: Samples, most_rows: int) -> None:
        if not len(samples.stamp_ns):
            return
        if self.first_ns is None:
            self.first_ns = int(samples.stamp_ns[0])
        self._timing.add(samples)
        full = ~np.isnan(samples.values).any(axis=1)
        self.whole.add(Samples(samples.stamp_ns[full], samples.values[full]))
        plain = Samples(samples.stamp_ns, samples.values)
        self._waiting.append(plain)
        self._waiting_rows += len(plain.stamp_ns)
        if self._waiting_rows >= BLOCK_ROWS:
            self._look()
        if self.complete:
            self.kept.append(plain)
            self._kept_rows += len(plain.stamp_ns)
            span = float(seconds(samples.stamp_ns[-1:], self.first_ns)[0])
            if self._kept_rows > most_rows or span > EXCERPT_S:
                self.complete = False
                self.kept.clear()

    def finish(self) -> Timing:
        self._look()
        return self._timing.finish()

    def excerpt(self) -> Samples:
        return joined(self.kept, len(self._names))

    def _look(self) -> None:
        block = joined(self._waiting, len(self._names))
        self._waiting, self._waiting_rows = [], 0
        if not len(block.stamp_ns) or self.first_ns is None:
            return
        time_s = seconds(block.stamp_ns, self.first_ns)
        forward = np.diff(time_s)
        forward = forward[forward > 0]
        rate_hz = 1.0 / float(np.median(forward)) if len(forward) else None
        with np.errstate(all="ignore"):  # absurd values overflow; they are reported by their range
            self.channels.add(time_s, block.values, rate_hz)
            self._note_motion(time_s, block.values)

    def _note_motion(self, time_s: Array, values: Array) -> None:
        theta = values[:, self._theta : self._theta + 3]
        change = np.nansum(np.square(np.where(np.isfinite(theta), theta, np.nan)[1:] - theta[:-1]), axis=1)
        bins, where = np.unique((time_s[1:] // _BIN_S).astype(np.int64), return_inverse=True)
        for k, energy, count in zip(bins, np.bincount(where, change), np.bincount(where), strict=True):
            self.lively[int(k)] = self.lively.get(int(k), 0.0) + float(energy)
            self.rows_per_bin = max(self.rows_per_bin, int(count))


def _liveliest(robots: list[_Robot], most_rows: int) -> tuple[int, int]:
    """Stamps between which the gimbals move most [ns]."""
    origin = min(robot.first_ns for robot in robots if robot.first_ns is not None)
    total: dict[int, float] = {}
    for robot in robots:
        if robot.first_ns is not None:
            shift = round(float(seconds(np.array(robot.first_ns), origin)) / _BIN_S)
            for k, energy in robot.lively.items():
                total[k + shift] = total.get(k + shift, 0.0) + energy
    largest = max(robot.rows_per_bin for robot in robots)
    width = max(1, min(int(EXCERPT_S / _BIN_S), most_rows // max(largest, 1)))
    starts = sorted(total)
    best = max(starts, key=lambda start: sum(total.get(k, 0.0) for k in range(start, start + width)))
    nanoseconds = 1_000_000_000
    return origin + round(best * _BIN_S) * nanoseconds, origin + round((best + width) * _BIN_S) * nanoseconds
