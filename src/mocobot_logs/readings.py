"""A log's readings: rows that a logger wrote again are left out and counted."""

from collections.abc import Callable, Iterator

import numpy as np

from estimator.quantisation import BLOCK, Repeats
from mocobot_logs.joints.quantities import COMMANDS, DUTIES, EFFORTS
from mocobot_logs.log import Level, LogSource, Samples, joined, rows_of

_EFFORTS = ("tau", "force_", *EFFORTS)
_UNMEASURED = ("ref_", *COMMANDS, *DUTIES, "supply", "enabled")
"""How names of channels begin, for teams and for joints, that hold measured efforts and no measurements at all."""


class Readings:
    """A log without rows that repeat the one before, as a ``LogSource``; ``Samples.repeats`` counts them."""

    def __init__(self, source: LogSource) -> None:
        """Take the log; nothing is read yet."""
        self.level: Level = source.level
        self.name, self.robots, self.channels = source.name, source.robots, source.channels
        self.metadata, self.size, self._source = source.metadata, source.size, source

    def chunks(self, advance: Callable[[int], object]) -> Iterator[tuple[int, Samples]]:
        """As ``LogSource.chunks``.

        Raises:
            InputError: the log is damaged, or holds what its map does not allow.
        """
        streams = [_Stream(self.channels) for _ in range(self.robots)]
        for robot, samples in self._source.chunks(advance):
            if (told := streams[robot].push(samples)) is not None:
                yield robot, told
        for robot, stream in enumerate(streams):
            if len((told := stream.finish()).stamp_ns):
                yield robot, told


class _Stream:
    """Rows of one robot; the last reading waits, as the next rows may repeat it."""

    def __init__(self, channels: tuple[str, ...]) -> None:
        self._measured = [k for k, name in enumerate(channels) if not name.startswith(_UNMEASURED)]
        efforts = [k for k, of in enumerate(self._measured) if channels[of].startswith(_EFFORTS)]
        self._repeats, self._channels = Repeats(efforts), len(channels)
        self._held = joined([], self._channels)
        self._waiting: list[Samples] = []
        self._rows = 0

    def push(self, samples: Samples) -> Samples | None:
        """Take rows; readings that are complete, once ``BLOCK`` rows are there."""
        self._waiting.append(samples)
        self._rows += len(samples.stamp_ns)
        return self._judged(self._rows // BLOCK * BLOCK) if self._rows >= BLOCK else None

    def finish(self) -> Samples:
        """The last readings."""
        return joined([self._judged(self._rows), self._held], self._channels)

    def _judged(self, rows: int) -> Samples:
        """Readings among the next rows, but for the last."""
        samples = joined(self._waiting, self._channels)
        self._waiting, self._rows = [rows_of(samples, slice(rows, None))], self._rows - rows
        again = self._repeats.of(samples.values[:rows, self._measured])
        held = [self._held] * len(self._held.stamp_ns)
        samples = joined([*held, rows_of(samples, slice(rows))], self._channels)
        again = np.concatenate([np.zeros(len(held), dtype=bool), again])
        again[1:] &= np.diff(samples.stamp_ns) != 0  # rows with one stamp are another matter
        kept = np.flatnonzero(~again)
        readings = rows_of(samples, kept)
        readings.repeats[:] += np.diff(kept, append=len(again)) - 1
        self._held = rows_of(readings, slice(-1, None))
        return rows_of(readings, slice(-1))


def repeated(rows: int) -> str:
    """What to say of rows that repeat the one before."""
    return f"{rows} row{'s' * (rows > 1)} repeat{'s' * (rows == 1)} the one before, and a reading counts once"
