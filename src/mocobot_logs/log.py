"""Measured logs before any check or resampling: every robot's samples with its own stamps.

Readers are sources that yield a log in chunks, so that long logs need not fit in memory. Samples are already in SI
units and in mocobot's channels. Gaps, NaN and decreasing stamps are still present, for ``inspect`` to report and for
the resampler to fill or refuse. Only rows that repeat a reading are left out (``Readings``), and counted.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from estimator.arrays import Array
from estimator.quantisation import BLOCK, Repeats
from estimator.recording.metadata import RecordingMetadata

Stamps = NDArray[np.int64]

Level = Literal["joint", "wrist"]
"""Driven angles and spring torques, or wrist positions and the springs' forces on the wrist."""

THETA = ("theta_z", "theta_y", "theta_x")
CHANNELS: dict[Level, tuple[str, ...]] = {
    "joint": ("phi1", "phi2", "phi3", *THETA, "tau1", "tau2", "tau3"),
    "wrist": ("h_x", "h_y", "h_z", *THETA, "force_x", "force_y", "force_z"),
}
"""Channels of one robot [rad, rad, N m] or [m, rad, N], in order."""
REF = ("ref_x", "ref_y", "ref_z")  # optional channels of one robot: commanded wrist position in {b} [m]
NS = 1e-9
"""One nanosecond [s]. Stamps are integer nanoseconds, since a float of the Unix time resolves only 0.24 us."""


@dataclass(frozen=True, eq=False)
class Samples:
    """Samples of one robot, in the order of the log."""

    stamp_ns: Stamps  # time of sampling by the robot's clock [ns], shape (q,)
    values: Array  # channels of the source [SI], NaN where a message lacked one, shape (q, C)
    log_ns: Stamps | None = None  # time of recording [ns], shape (q,), or None if the format has none
    # number of omitted rows after each row that repeat it, shape (q,); zero if not given
    repeats: Stamps = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        if self.repeats is None:
            object.__setattr__(self, "repeats", np.zeros(len(self.stamp_ns), np.int64))


class LogSource(Protocol):
    """A log that can be read in chunks, any number of times.

    Attributes:
        name: path as the user gave it, used in messages.
        level: level of its channels.
        robots: number of robots.
        channels: columns of ``Samples.values``: ``CHANNELS[level]``, then ``REF`` if the log has commands.
        metadata: metadata of a log that mocobot wrote, else None.
        size: total amount to read, in units of ``advance`` (bytes, rows or messages).
    """

    name: str
    level: Level
    robots: int
    channels: tuple[str, ...]
    metadata: RecordingMetadata | None
    size: int

    @property
    def notes(self) -> Sequence[str]:
        """Sentences on irregularities and how they were handled; complete once the log is read."""
        ...

    def chunks(self, advance: Callable[[int], object]) -> Iterator[tuple[int, Samples]]:
        """Yield samples in the order of the log: (robot from 0, its next samples).

        ``advance`` is called with the progress since the last call.
        """
        ...


@dataclass(frozen=True, eq=False)
class Log:
    # name, level, channels, metadata, notes: as in ``LogSource``
    name: str
    level: Level
    channels: tuple[str, ...]
    metadata: RecordingMetadata | None
    streams: tuple[Samples, ...]  # samples of every robot
    notes: tuple[str, ...] = ()

    @property
    def robots(self) -> int:
        return len(self.streams)


def collect(source: LogSource, advance: Callable[[int], object] = lambda _: None) -> Log:
    parts: list[list[Samples]] = [[] for _ in range(source.robots)]
    for robot, samples in source.chunks(advance):
        parts[robot].append(samples)
    streams = tuple(joined(p, len(source.channels)) for p in parts)
    return Log(source.name, source.level, source.channels, source.metadata, streams, tuple(source.notes))


def joined(parts: Sequence[Samples], channels: int) -> Samples:
    """Concatenate samples of one robot; ``log_ns`` is kept only if every part has it."""
    if not parts:
        return Samples(np.empty(0, np.int64), np.empty((0, channels)))
    logs = [part.log_ns for part in parts if part.log_ns is not None]
    return Samples(
        np.concatenate([part.stamp_ns for part in parts]),
        np.concatenate([part.values for part in parts]),
        np.concatenate(logs) if len(logs) == len(parts) else None,
        np.concatenate([part.repeats for part in parts]),
    )


def rows_of(samples: Samples, keep: NDArray[np.bool_] | NDArray[np.intp] | slice) -> Samples:
    """Return some rows, by mask, indices or slice."""
    log_ns = None if samples.log_ns is None else samples.log_ns[keep]
    return Samples(samples.stamp_ns[keep], samples.values[keep], log_ns, samples.repeats[keep])


_EFFORTS = ("tau", "force_", "torque", "link_torque", "motor_torque", "current")
_UNMEASURED = (
    "ref_", "command", "motor_command", "feedforward", "duty", "motor_voltage", "supply", "enabled"
)  # fmt: skip
"""Prefixes of channel names, for teams and joints: measured efforts, and channels that are no measurements."""


class Selection:
    """What a log that yields some rows of another ``source`` has in common with it; subclasses add ``chunks``."""

    def __init__(self, source: LogSource, name: str | None = None) -> None:
        self.name, self.source = name or source.name, source
        self.level: Level = source.level
        self.robots, self.channels = source.robots, source.channels
        self.metadata, self.size = source.metadata, source.size

    @property
    def notes(self) -> Sequence[str]:
        return self.source.notes


class Readings(Selection):
    """A log without rows that repeat the previous reading, as a ``LogSource``; ``Samples.repeats`` counts them."""

    def chunks(self, advance: Callable[[int], object]) -> Iterator[tuple[int, Samples]]:
        streams = [_Stream(self.channels) for _ in range(self.robots)]
        for robot, samples in self.source.chunks(advance):
            if (told := streams[robot].push(samples)) is not None:
                yield robot, told
        for robot, stream in enumerate(streams):
            if len((told := stream.finish()).stamp_ns):
                yield robot, told


class _Stream:
    """Rows of one robot; the last reading is held back, since the next rows may repeat it."""

    def __init__(self, channels: tuple[str, ...]) -> None:
        self._measured = [k for k, name in enumerate(channels) if not name.startswith(_UNMEASURED)]
        efforts = [k for k, of in enumerate(self._measured) if channels[of].startswith(_EFFORTS)]
        self._repeats, self._channels = Repeats(efforts), len(channels)
        self._held = joined([], self._channels)
        self._waiting: list[Samples] = []
        self._rows = 0

    def push(self, samples: Samples) -> Samples | None:
        """Add rows; return the complete readings once ``BLOCK`` rows are waiting."""
        self._waiting.append(samples)
        self._rows += len(samples.stamp_ns)
        return self._judged(self._rows // BLOCK * BLOCK) if self._rows >= BLOCK else None

    def finish(self) -> Samples:
        return joined([self._judged(self._rows), self._held], self._channels)

    def _judged(self, rows: int) -> Samples:
        """Return the readings among the next rows, except the last."""
        samples = joined(self._waiting, self._channels)
        self._waiting, self._rows = [rows_of(samples, slice(rows, None))], self._rows - rows
        again = self._repeats.of(samples.values[:rows, self._measured])
        held = [self._held] * len(self._held.stamp_ns)
        samples = joined([*held, rows_of(samples, slice(rows))], self._channels)
        again = np.concatenate([np.zeros(len(held), dtype=bool), again])
        again[1:] &= np.diff(samples.stamp_ns) != 0  # equal stamps mean duplicates, not repeats
        kept = np.flatnonzero(~again)
        readings = rows_of(samples, kept)
        readings.repeats[:] += np.diff(kept, append=len(again)) - 1
        self._held = rows_of(readings, slice(-1, None))
        return rows_of(readings, slice(-1))


def repeated(rows: int) -> str:
    return f"{rows} row{'s' * (rows > 1)} repeat{'s' * (rows == 1)} the one before, and a reading counts once"
