"""Logs made from arrays, handed out in any pieces."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from mocobot_logs.log import CHANNELS, Level, Samples


@dataclass
class ArrayLog:
    """A log whose robots' rows come in pieces of ``rows`` in turn.

    Counts how often it is read.
    """

    streams: Sequence[Samples]
    rows: int = 1000
    name: str = "made.log"
    level: Level = "joint"
    metadata: object = None
    reads: int = 0

    @property
    def notes(self) -> tuple[str, ...]:
        return ()

    @property
    def robots(self) -> int:
        return len(self.streams)

    @property
    def channels(self) -> tuple[str, ...]:
        return CHANNELS[self.level]

    @property
    def size(self) -> int:
        return sum(len(stream.stamp_ns) for stream in self.streams)

    def chunks(self, advance: Callable[[int], object]) -> Iterator[tuple[int, Samples]]:
        self.reads += 1
        longest = max(len(stream.stamp_ns) for stream in self.streams)
        for first in range(0, longest, self.rows):
            part = slice(first, first + self.rows)
            for robot, stream in enumerate(self.streams):
                if len(stamp := stream.stamp_ns[part]):
                    log = None if stream.log_ns is None else stream.log_ns[part]
                    yield robot, Samples(stamp, stream.values[part], log)
                    advance(len(stamp))


def stream(time_s, values, start_ns: int = 0, log_ns=None) -> Samples:
    """Samples at times [s] after ``start_ns``; values (q, C)."""
    return Samples(start_ns + np.rint(np.asarray(time_s) * 1e9).astype(np.int64), np.asarray(values), log_ns)


def tones(time_s, frequencies_hz, channels: int = 9) -> np.ndarray:
    """A sum of sines of amplitude 1, other phases in every channel, shape (q, C)."""
    phase = np.arange(channels)[:, None] + np.arange(len(frequencies_hz))
    angle = 2 * np.pi * np.multiply.outer(np.asarray(time_s), np.asarray(frequencies_hz))
    return np.sin(angle[:, None] + phase).sum(axis=-1)
