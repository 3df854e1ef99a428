"""A log's readings: rows that a logger wrote again are left out and counted."""

from collections.abc import Callable, Iterator

import numpy as np

from estimator.repeats import BLOCK, Repeats
from mocobot_logs.joints.quantities import COMMANDS, DUTIES, EFFORTS
from mocobot_logs.log import LogSource, Samples, joined, rows_of

_EFFORTS = ("tau", "force_", *EFFORTS)
_UNMEASURED = ("ref_", *COMMANDS, *DUTIES, "supply", "enabled")
"""How names of channels begin, for teams and for joints, that hold measured efforts and no measurements at all."""


class Readings:
    """A log without rows that repeat the one before, as a ``LogSource``; ``Samples.repeats`` counts them."""

    def __init__(self, source: LogSource) -> None:
        """Take the log; nothing is read yet."""
        self.name, self.level, self.robots = source.name, source.level, source.robots
        self.channels, self.metadata, self.size = source.channels, source.metadata, source.size
        self._source = source

    def chunks(self, advance: Callable[[int], object]) -> Iterator[tuple[int, Samples]]:
        """As ``LogSource.chunks``.

        Raises:
            InputError: the log is damaged, or holds what its map does not allow.
        """
        streams = [_Stream(self.channels) for _ in range(self.robots)]
        for robot, samples in self._source.chunks(advance):
            yield from ((robot, kept) for kept in streams[robot].push(samples))
        for robot, stream in enumerate(streams):
            yield from ((robot, kept) for kept in stream.finish())


class _Stream:
    """Rows of one robot; the last reading waits, as the next rows may repeat it."""

    def __init__(self, channels: tuple[str, ...]) -> None:
        self._measured = [k for k, name in enumerate(channels) if not name.startswith(_UNMEASURED)]
        named = [channels[k] for k in self._measured]
        self._repeats = Repeats([k for k, name in enumerate(named) if name.startswith(_EFFORTS)])
        self._waiting: list[Samples] = []
        self._rows, self._channels = 0, len(channels)
        self._held: Samples | None = None

    def push(self, samples: Samples) -> Iterator[Samples]:
        if self._waiting and (self._waiting[0].log_ns is None) != (samples.log_ns is None):
            yield from self._flush(self._rows)
        self._waiting.append(samples)
        self._rows += len(samples.stamp_ns)
        if self._rows >= BLOCK:  # a source may hand out rows one by one
            yield from self._flush(self._rows // BLOCK * BLOCK)

    def finish(self) -> Iterator[Samples]:
        yield from self._flush(self._rows)
        if self._held is not None:
            yield self._held

    def _flush(self, rows: int) -> Iterator[Samples]:
        """Judge the next rows and give out readings but the last."""
        if not rows:
            return
        samples = joined(self._waiting, self._channels)
        self._waiting, self._rows = [rows_of(samples, slice(rows, None))], self._rows - rows
        samples = rows_of(samples, slice(rows))
        again = self._repeats.of(samples.values[:, self._measured])
        if self._held is not None:
            samples, again = joined([self._held, samples], self._channels), np.concatenate([[False], again])
        again[1:] &= np.diff(samples.stamp_ns) != 0  # rows with one stamp are another matter
        kept = np.flatnonzero(~again)
        readings = rows_of(samples, kept)
        readings.repeats[:] += np.diff(kept, append=len(again)) - 1
        self._held = rows_of(readings, slice(-1, None))
        if len(kept) > 1:
            yield rows_of(readings, slice(-1))


def repeated(rows: int) -> str:
    """What to say of rows that repeat the one before."""
    return f"{rows} row{'s' * (rows > 1)} repeat{'s' * (rows == 1)} the one before, and a reading counts once"
