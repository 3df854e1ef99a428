"""A part of a log, as a log."""

from collections.abc import Callable, Iterator

import numpy as np

from mocobot_logs.cut.choice import Drop, Span
from mocobot_logs.log import Level, LogSource, Samples, rows_of


class Piece:
    """What a log has in a span of time, without what is dropped, as a ``LogSource``."""

    def __init__(self, source: LogSource, origin_ns: int, span: Span | None, drops: tuple[Drop, ...]) -> None:
        """Take the log; nothing is read yet.

        Args:
            source: the log.
            origin_ns: stamp from which span and drops count [ns].
            span: what is kept, None for all.
            drops: what is left out.
        """
        self.name = source.name if span is None else f"{source.name} ({span})"
        self.level: Level = source.level
        self.robots, self.channels = source.robots, source.channels
        self.metadata, self.size = source.metadata, source.size
        self.span, self._source, self._origin_ns = span, source, origin_ns
        self._drops = [[d.span for d in drops if d.robot == i + 1] for i in range(source.robots)]

    def chunks(self, advance: Callable[[int], object]) -> Iterator[tuple[int, Samples]]:
        """As ``LogSource.chunks``; what comes after the span is not read.

        Raises:
            InputError: the log is damaged, or holds what its map does not allow.
        """
        passed = [False] * self.robots
        for robot, samples in self._source.chunks(advance):
            after = samples.stamp_ns - self._origin_ns
            keep = np.ones(len(after), bool)
            if self.span is not None:
                keep &= (after >= self.span.first_ns) & (after <= self.span.last_ns)
                passed[robot] |= bool(len(after) and after[-1] > self.span.last_ns)
            for span in self._drops[robot]:
                keep &= (after < span.first_ns) | (after > span.last_ns)
            if keep.any():
                yield robot, samples if keep.all() else rows_of(samples, keep)
            if all(passed):
                return
