"""Rows of one robot whose channels come from several topics: the fastest topic sets the rows.

At its stamps, messages of the other topics with the same stamp are taken bit for bit. Where there is none, a topic is
interpolated by the cubic through two samples on either side: of a sine sampled at 100 Hz it misses 4e-7 of the
amplitude at 1 Hz and 2.3e-4 at 5 Hz (3/128 of the fourth power of the phase from sample to sample). Nothing is thinned
out here, so nothing aliases. There is no row where a topic has no samples: before its first, after its last, and where
it has a gap.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimator.errors import InputError
from mocobot_logs.log import NS, Array, Samples, Stamps

MAX_GAP_NS = 50_000_000
"""Longest time without samples of a topic, beyond its period, that is interpolated [ns]."""
HELD = 1 << 16
"""Most messages of a topic that wait for those of another one."""
_AT_ONCE = 4096
_SAME = 1.25  # periods of topics that are as fast as each other
_CROWDED = 0.25  # of a period: closer samples leave only noise in differences between them


@dataclass(frozen=True, eq=False)
class Part:
    """Messages of one topic in a block.

    Attributes:
        stamp_ns, log_ns: as in ``Samples``, shape (q,).
        columns: channels that the topic has.
        values: these channels [SI], shape (q, len(columns)).
    """

    stamp_ns: Stamps
    log_ns: Stamps
    columns: NDArray[np.intp]
    values: Array


class RowAligner:
    """Brings several topics of one robot onto the stamps of one of them."""

    def __init__(
        self, where: str, names: tuple[str, ...], periods_ns: tuple[float, ...], channels: int
    ) -> None:
        """Prepare.

        Args:
            where: what messages call the robot.
            names: its topics.
            periods_ns: their median periods [ns]; the first of those that are about the shortest sets the rows.
            channels: number of channels C of a row.
        """
        self._where, self._names, self._periods, self._channels = where, names, periods_ns, channels
        self._leader = next(k for k, period in enumerate(periods_ns) if period <= _SAME * min(periods_ns))
        self._topics = [_Topic.empty() for _ in names]
        self._columns: list[NDArray[np.intp]] = [np.empty(0, np.intp) for _ in names]

    def push(self, parts: Mapping[int, Part]) -> Samples | None:
        """Take a block (topic from 0: its messages) and return the rows that are ready, if any.

        Raises:
            InputError: the stamps of a topic run back.
        """
        for number, part in parts.items():
            self._columns[number] = part.columns
            if number != self._leader:
                self._check(number, part.stamp_ns)
            self._topics[number].append(part)
        leader = self._topics[self._leader]
        others = [topic for topic in self._topics if topic is not leader]
        if len(leader) < _AT_ONCE and all(len(topic) < HELD for topic in others):
            return None
        # Two samples are needed behind every row.
        until = min(int(topic.stamp_ns[-2]) if len(topic) > 1 else -(1 << 62) for topic in others)
        ready = int(np.argmax(leader.stamp_ns > until)) if (leader.stamp_ns > until).any() else len(leader)
        return self._rows(max(ready, len(leader) - HELD))

    def finish(self) -> Samples | None:
        """The rows that are left, if any."""
        return self._rows(len(self._topics[self._leader]))

    def _rows(self, ready: int) -> Samples | None:
        rows, self._topics[self._leader] = self._topics[self._leader].split(ready)
        values = np.full((ready, self._channels), np.nan)
        values[:, self._columns[self._leader]] = rows.values
        good = np.ones(ready, bool)
        for number, topic in enumerate(self._topics):
            if number == self._leader:
                continue
            found = _interpolated(topic, rows.stamp_ns, self._periods[number])
            good &= found[1]
            if len(topic):
                values[:, self._columns[number]] = found[0]
            keep = max(len(topic) - HELD // 2, 0)
            if ready:  # what later rows need: two samples before the last row
                keep = max(keep, int(np.searchsorted(topic.stamp_ns, rows.stamp_ns[-1])) - 2)
            self._topics[number] = topic.split(keep)[1]
        if not good.any():
            return None
        return Samples(rows.stamp_ns[good], values[good], rows.log_ns[good])

    def _check(self, number: int, stamp_ns: Stamps) -> None:
        last = self._topics[number].stamp_ns[-1:]
        steps = np.diff(np.concatenate([last, stamp_ns]))
        if len(steps) and steps.min() < 0:
            raise InputError(
                f"{self._where}: the stamps of topic {self._names[number]} run back by {-steps.min() * NS:.9g} s; "
                "topics can be brought together only if their stamps increase"
            )


class _Topic:
    """Messages of one topic that are held."""

    def __init__(self, stamp_ns: Stamps, log_ns: Stamps, values: Array) -> None:
        self.stamp_ns, self.log_ns, self.values = stamp_ns, log_ns, values

    @classmethod
    def empty(cls) -> _Topic:
        return cls(np.empty(0, np.int64), np.empty(0, np.int64), np.empty((0, 0)))

    def __len__(self) -> int:
        return len(self.stamp_ns)

    def append(self, part: Part) -> None:
        values = self.values if len(self) else np.empty((0, part.values.shape[1]))
        self.stamp_ns = np.concatenate([self.stamp_ns, part.stamp_ns])
        self.log_ns = np.concatenate([self.log_ns, part.log_ns])
        self.values = np.concatenate([values, part.values])

    def split(self, at: int) -> tuple[_Topic, _Topic]:
        return (
            _Topic(self.stamp_ns[:at], self.log_ns[:at], self.values[:at]),
            _Topic(self.stamp_ns[at:], self.log_ns[at:], self.values[at:]),
        )


def _interpolated(topic: _Topic, at_ns: Stamps, period_ns: float) -> tuple[Array, NDArray[np.bool_]]:
    """Values at some stamps, and where the topic has any to either side that are close enough."""
    fresh = np.ones(len(topic), bool)
    fresh[1:] = topic.stamp_ns[1:] > topic.stamp_ns[:-1]  # repeated stamps say nothing new
    stamp, values = topic.stamp_ns[fresh], topic.values[fresh]
    if len(stamp) < 2:
        return np.full((len(at_ns), values.shape[1]), np.nan), np.zeros(len(at_ns), bool)
    after = np.clip(np.searchsorted(stamp, at_ns), 1, len(stamp) - 1)
    nodes = after[:, None] + np.arange(-2, 2)
    cubic = (nodes[:, 0] >= 0) & (nodes[:, -1] < len(stamp))
    nodes = np.clip(nodes, 0, len(stamp) - 1)
    time = (stamp[nodes] - at_ns[:, None]) / period_ns  # differences first: stamps are too large for floats
    steps = np.diff(time, axis=1)
    longest = 1.0 + MAX_GAP_NS / period_ns
    good = (time[:, 1] <= 0.0) & (time[:, 2] >= 0.0) & (steps[:, 1] <= longest)
    cubic &= (steps.min(axis=1) > _CROWDED) & (steps.max(axis=1) <= longest)
    weights = np.zeros((len(at_ns), 4))
    weights[:, 2] = time[:, 1] / np.where(steps[:, 1] > 0.0, -steps[:, 1], 1.0)
    weights[:, 1] = 1.0 - weights[:, 2]
    weights[cubic] = _lagrange(time[cubic])
    for node in (1, 2):
        same = time[:, node] == 0.0
        weights[same] = np.arange(4) == node
        good |= same
    # Of samples without weight not even a NaN may count.
    return np.einsum("qn,qnc->qc", weights, np.where(weights[..., None] != 0.0, values[nodes], 0.0)), good


def _lagrange(time: Array) -> Array:
    """Weights of samples at ``time`` (q, n) for the value at 0."""
    weights = np.ones_like(time)
    for k in range(time.shape[1]):
        for j in range(time.shape[1]):
            if j != k:
                weights[:, k] *= time[:, j] / (time[:, j] - time[:, k])
    return weights
