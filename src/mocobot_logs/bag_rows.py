"""Rows of one robot whose channels come from several topics: messages with the same stamp become one row."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mocobot_logs.log import Array, Samples, Stamps

WAIT = 4096
"""So many messages of its robot a row waits for the rest of its channels."""


@dataclass(frozen=True, eq=False)
class Part:
    """Messages of one topic in a block.

    Attributes:
        stamp_ns, log_ns: as in ``Samples``, shape (q,).
        order: place of each message in the block, shape (q,).
        columns: channels that the topic has.
        values: these channels [SI], shape (q, len(columns)).
    """

    stamp_ns: Stamps
    log_ns: Stamps
    order: NDArray[np.int64]
    columns: NDArray[np.intp]
    values: Array


class RowJoiner:
    """Joins messages of several topics by their stamps.

    The n-th message of a topic with a stamp goes with the n-th of every other topic with that stamp. Rows come out in
    the order of their first message. A row that is not complete waits for the next ``WAIT`` messages of its robot, then
    it comes out with NaN.
    """

    def __init__(self, topics: int, channels: int) -> None:
        """Prepare.

        Args:
            topics: number of topics.
            channels: number of channels C of a row.
        """
        self._topics, self._channels = topics, channels
        self._waiting: _Rows = _Rows.empty(channels)
        self._new: list[_Rows] = []
        self._count = 0

    def push(self, parts: Mapping[int, Part]) -> Samples | None:
        """Take a block (topic from 0: its messages) and return the rows that are ready, if any."""
        self._new.append(_Rows.of(parts, self._channels))
        self._count += len(self._new[-1].stamp_ns)
        return self._pop(len(self._waiting.stamp_ns)) if self._count >= WAIT else None

    def finish(self) -> Samples | None:
        """The rows that are left, if any."""
        return self._pop(None)

    def _pop(self, waited: int | None) -> Samples | None:
        """Rows up to the first that is neither complete nor among the messages that have waited (None: all have)."""
        rows = _Rows.joined([self._waiting, *self._new])
        self._new, self._count = [], 0
        if not len(rows.stamp_ns):
            return None
        group, first = _groups(rows)
        waits = np.bincount(group, minlength=len(first)) < self._topics
        waits &= first >= (len(group) if waited is None else waited)
        ready = (
            int(np.argmax(waits)) if waits.any() else len(first)
        )  # groups are in the order of their first message
        out = group < ready
        self._waiting = rows.where(~out)
        if not ready:
            return None
        values = np.full((ready, self._channels), np.nan)
        for topic in range(self._topics):
            mine = np.flatnonzero(out & (rows.topic == topic))
            # Topics have channels of their own, so nothing is overwritten.
            values[group[mine]] = np.where(
                np.isnan(rows.values[mine]), values[group[mine]], rows.values[mine]
            )
        return Samples(rows.stamp_ns[first[:ready]], values, rows.log_ns[first[:ready]])


@dataclass(frozen=True, eq=False)
class _Rows:
    """One row per message, in the order of the bag, NaN in the channels of other topics."""

    stamp_ns: Stamps
    log_ns: Stamps
    topic: NDArray[np.int64]
    values: Array

    @classmethod
    def empty(cls, channels: int) -> _Rows:
        none = np.empty(0, np.int64)
        return cls(none, none, none, np.empty((0, channels)))

    @classmethod
    def of(cls, parts: Mapping[int, Part], channels: int) -> _Rows:
        rows = []
        for topic, part in parts.items():
            values = np.full((len(part.stamp_ns), channels), np.nan)
            values[:, part.columns] = part.values
            rows.append(cls(part.stamp_ns, part.log_ns, np.full(len(values), topic, np.int64), values))
        return cls.joined(rows).where(
            np.argsort(np.concatenate([p.order for p in parts.values()]), kind="stable")
        )

    @classmethod
    def joined(cls, rows: Sequence[_Rows]) -> _Rows:
        return cls(
            np.concatenate([r.stamp_ns for r in rows]),
            np.concatenate([r.log_ns for r in rows]),
            np.concatenate([r.topic for r in rows]),
            np.concatenate([r.values for r in rows]),
        )

    def where(self, index: NDArray) -> _Rows:
        return _Rows(self.stamp_ns[index], self.log_ns[index], self.topic[index], self.values[index])


def _groups(rows: _Rows) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Group of every message, groups counted in the order of their first message, and that message."""
    stamp, topic = rows.stamp_ns, rows.topic
    order = np.lexsort((topic, stamp))
    begins = _changes(stamp[order], topic[order])
    place = np.arange(len(order))
    occurrence = np.empty(len(order), np.intp)
    occurrence[order] = place - np.maximum.accumulate(np.where(begins, place, 0))
    order = np.lexsort((occurrence, stamp))
    begins = _changes(stamp[order], occurrence[order])
    first = np.minimum.reduceat(order, np.flatnonzero(begins))
    rank = np.empty(len(first), np.intp)
    rank[np.argsort(first)] = np.arange(len(first))
    group = np.empty(len(order), np.intp)
    group[order] = rank[np.cumsum(begins) - 1]
    return group, np.sort(first)


def _changes(*keys: NDArray) -> NDArray[np.bool_]:
    """Where sorted keys differ from the one before."""
    begins = np.ones(len(keys[0]), bool)
    begins[1:] = np.any([key[1:] != key[:-1] for key in keys], axis=0)
    return begins
