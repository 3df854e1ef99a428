"""A measured log on uniform grids: for every robot its own, by its own stamps, at one rate.

What is done to a stream, and its report, follow from its stamps:

- *untouched*: every stamp within 1 us of the grid that begins at the robot's first stamp. Its samples are taken
  bit for bit; so a round trip of a recording changes nothing.
- *filtered*: the same for a grid k times as fine: an FIR low-pass and every k-th sample.
- *fitted*: many samples at uneven instants: polynomials through the nearest of them (``grid``), the low-pass, every
  k-th sample.
- *interpolated*: any other stream: a quintic spline onto a finer grid, the low-pass, every k-th sample.

Missing samples are filled in first (``fill``), but where samples are fitted. The anti-alias rule and its numbers are
those of ``filter``. What the low-pass needs, a tenth of a second, is lost at either end.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from estimator.errors import InputError
from estimator.recording.metadata import RecordingMetadata
from mocobot_logs.log import NS, Array, Level, LogSource
from mocobot_logs.resample.report import StreamReport
from mocobot_logs.resample.stream import RobotStream

RATE_HZ = 100.0
MAX_GAP_S = 0.08
"""Longest time without samples, beyond one period, that is filled in [s]: four in a row lost at 50 Hz.

What is filled in there is off by 7 urad and 5 mN m (rms, random trials; 0.4 urad and 0.04 mN m in periodic ones),
for as long as the gap lasts. With 0.12 s it would be 48 urad and 15 mN m.
"""


@dataclass(frozen=True, eq=False)
class Resampled:
    """A log on one uniform grid per robot.

    Attributes:
        name, level, channels, metadata: as in ``LogSource``.
        rate_hz: rate of every grid [Hz].
        origin_ns: the earliest stamp of the log [ns].
        start_s: first instant of every robot's grid after the origin, by the robot's stamps [s], shape (N,).
        values: samples [SI] of every robot, N arrays of shape (Q_i, C).
        reports: what was found and done, N entries.
    """

    name: str
    level: Level
    channels: tuple[str, ...]
    metadata: RecordingMetadata | None
    rate_hz: float
    origin_ns: int
    start_s: Array
    values: tuple[Array, ...]
    reports: tuple[StreamReport, ...]

    @property
    def robots(self) -> int:
        """Number of robots N."""
        return len(self.values)


def resample(
    source: LogSource,
    rate_hz: float = RATE_HZ,
    max_gap_s: float = MAX_GAP_S,
    advance: Callable[[int], object] = lambda _: None,
) -> Resampled:
    """Bring a log onto uniform grids, chunk by chunk; only what comes out is kept in memory.

    The source is read a second time if a robot's stamps leave a grid that its first 1024 are on.

    Args:
        source: the log.
        rate_hz: rate of the grids [Hz].
        max_gap_s: longest time without samples beyond one period [s].
        advance: takes the progress made, in the source's units.

    Raises:
        InputError: the log cannot be read; a robot has fewer than 16 samples, too slow or too fast ones, values
            that are not finite, time that runs back, one stamp with two values, a gap that is too long, or more
            than 10 % of its samples missing or crowding; or two robots have no time in common.
    """
    streams: dict[int, RobotStream] = {}
    done: dict[int, tuple[int, Array, StreamReport]] = {}
    for may_fit in (True, False):
        again = [robot for robot in range(source.robots) if robot not in done]
        if not again:
            break
        streams |= {
            robot: RobotStream(source.name, robot + 1, source.channels, rate_hz, max_gap_s, may_fit=may_fit)
            for robot in again
        }
        for robot, samples in source.chunks(advance if may_fit else lambda _: None):
            if robot not in done:
                streams[robot].push(samples)
        for robot in again:
            result = streams[robot].finish()
            if not streams[robot].left_grid:
                done[robot] = result
    order = range(source.robots)
    _check_common_time(source.name, [streams[robot] for robot in order])
    starts_ns = [done[robot][0] for robot in order]
    origin_ns = min(done[robot][2].first_ns for robot in order)
    return Resampled(
        name=source.name,
        level=source.level,
        channels=source.channels,
        metadata=source.metadata,
        rate_hz=rate_hz,
        origin_ns=origin_ns,
        start_s=np.array([(start - origin_ns) * NS for start in starts_ns]),
        values=tuple(done[robot][1] for robot in order),
        reports=tuple(done[robot][2] for robot in order),
    )


def _check_common_time(name: str, streams: list[RobotStream]) -> None:
    """Two robots whose stamps never meet have different epochs."""
    spans = [(s.screen.first_ns or 0, s.screen.last_ns or 0) for s in streams]
    late = max(range(len(spans)), key=lambda i: spans[i][0])
    early = min(range(len(spans)), key=lambda i: spans[i][1])
    if spans[late][0] < spans[early][1]:
        return
    logs = [s.screen.log_ns for s in streams]
    hint = ""
    known = [log for log in logs if log is not None]
    if len(known) == len(logs) and max(a for a, _ in known) < min(b for _, b in known):
        hint = ", or use the recorder's time, which they share (clock = \"log\" in the map's [time])"
    pair = sorted((early, late))
    words = " and ".join(
        f"robot {i + 1} has {spans[i][0] * NS:.3f} to {spans[i][1] * NS:.3f} s" for i in pair
    )
    raise InputError(f"{name}: {words}, no time in common; all stamps must come from one clock{hint}")
