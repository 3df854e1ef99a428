"""A measured log as it comes: every robot's samples with its own stamps, nothing checked or resampled yet.

Readers are sources: they hand out a log in chunks, so that an hour of ten robots at 1 kHz never has to be in memory.
What they hand out is in SI units and in mocobot's channels already; what is wrong with the samples (gaps, NaN, time
running backwards) is still in it, for ``inspect`` to see and for the resampler to fill or refuse.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from estimator.arrays import Array
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
REF = ("ref_x", "ref_y", "ref_z")
"""Optional channels of one robot: commanded wrist position in {b} [m]."""
NS = 1e-9
"""One nanosecond [s]: stamps are whole nanoseconds, since a float of the Unix time resolves 0.24 us only."""


@dataclass(frozen=True, eq=False)
class Samples:
    """Samples of one robot, in the order of the log.

    Attributes:
        stamp_ns: when the robot says it took them [ns], shape (q,).
        values: the source's channels [SI], NaN where a message lacked one, shape (q, C).
        log_ns: when the recorder wrote them [ns], shape (q,), or None where the format does not say.
        repeats: rows after each that repeat it and are left out, shape (q,); none if not given.
    """

    stamp_ns: Stamps
    values: Array
    log_ns: Stamps | None = None
    repeats: Stamps = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        """Without word of any, no row is left out."""
        if self.repeats is None:
            object.__setattr__(self, "repeats", np.zeros(len(self.stamp_ns), np.int64))


class LogSource(Protocol):
    """A log that can be read in chunks, any number of times.

    Attributes:
        name: what messages call it, the path as the user gave it.
        level: which channels it has.
        robots: number of robots.
        channels: columns of ``Samples.values``: ``CHANNELS[level]``, then ``REF`` if the log has commands.
        metadata: what the log says about itself where it was written by mocobot, else None.
        size: all that there is to read, in units of ``advance`` (bytes, rows or messages).
    """

    name: str
    level: Level
    robots: int
    channels: tuple[str, ...]
    metadata: RecordingMetadata | None
    size: int

    def chunks(self, advance: Callable[[int], object]) -> Iterator[tuple[int, Samples]]:
        """Samples of one robot after the other as the log has them: (robot from 0, its next samples).

        Args:
            advance: takes the progress made since the last call.

        Raises:
            InputError: the log is damaged, or holds what its map does not allow.
        """
        ...


@dataclass(frozen=True, eq=False)
class Log:
    """A whole log in memory.

    Attributes:
        name, level, channels, metadata: as in ``LogSource``.
        streams: samples of every robot.
    """

    name: str
    level: Level
    channels: tuple[str, ...]
    metadata: RecordingMetadata | None
    streams: tuple[Samples, ...]

    @property
    def robots(self) -> int:
        """Number of robots N."""
        return len(self.streams)


def collect(source: LogSource, advance: Callable[[int], object] = lambda _: None) -> Log:
    """Read a whole source.

    Raises:
        InputError: see ``LogSource.chunks``.
    """
    parts: list[list[Samples]] = [[] for _ in range(source.robots)]
    for robot, samples in source.chunks(advance):
        parts[robot].append(samples)
    streams = tuple(joined(p, len(source.channels)) for p in parts)
    return Log(source.name, source.level, source.channels, source.metadata, streams)


def joined(parts: Sequence[Samples], channels: int) -> Samples:
    """Samples of one robot in one piece; ``log_ns`` only where every part has it."""
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
    """Some of the rows, by a mask or by their numbers."""
    log_ns = None if samples.log_ns is None else samples.log_ns[keep]
    return Samples(samples.stamp_ns[keep], samples.values[keep], log_ns, samples.repeats[keep])
