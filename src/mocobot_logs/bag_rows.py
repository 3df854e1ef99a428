"""Rows of one robot whose channels come from several topics: messages with the same stamp become one row."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mocobot_logs.log import Array, Samples, Stamps


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
    the order of their first message. A row that is not complete waits for one more block, since its messages may lie
    on both sides of the end of a block; after that it comes out with NaN.
    """

    def __init__(self, topics: int, channels: int) -> None:
        """Prepare.

        Args:
            topics: number of topics.
            channels: number of channels C of a row.
        """
        self._topics, self._channels = topics, channels
        self._stamp: Stamps = np.empty(0, np.int64)
        self._log: Stamps = np.empty(0, np.int64)
        self._topic: NDArray[np.intp] = np.empty(0, np.intp)
        self._values: Array = np.empty((0, channels))

    def push(self, parts: dict[int, Part]) -> Samples | None:
        """Take a block (topic from 0: its messages) and return the rows that are ready, if any."""
        waited = len(self._stamp)
        if parts:
            self._append(parts)
        return self._pop(waited) if len(self._stamp) else None

    def _append(self, parts: dict[int, Part]) -> None:
        order = np.argsort(np.concatenate([part.order for part in parts.values()]), kind="stable")
        values = np.full((len(order), self._channels), np.nan)
        topic = np.empty(len(order), np.intp)
        begin = 0
        for number, part in parts.items():
            rows = np.arange(begin, begin + len(part.stamp_ns))
            values[rows[:, None], part.columns] = part.values
            topic[rows] = number
            begin += len(rows)
        stamp = np.concatenate([part.stamp_ns for part in parts.values()])
        log = np.concatenate([part.log_ns for part in parts.values()])
        self._stamp = np.concatenate([self._stamp, stamp[order]])
        self._log = np.concatenate([self._log, log[order]])
        self._topic = np.concatenate([self._topic, topic[order]])
        self._values = np.concatenate([self._values, values[order]])

    def _pop(self, waited: int) -> Samples | None:
        """Rows up to the first that has neither all its topics nor waited for a block."""
        group, first = self._groups()
        complete = np.bincount(group, minlength=len(first)) == self._topics
        held = ~complete & (first >= waited)
        ready = (
            int(np.argmax(held)) if held.any() else len(first)
        )  # groups are in the order of their first message
        out = group < ready
        samples = None
        if ready:
            values = np.full((ready, self._channels), np.nan)
            for topic in range(self._topics):
                rows = out & (self._topic == topic)
                filled = ~np.isnan(self._values[rows])
                target = values[group[rows]]
                target[filled] = self._values[rows][filled]
                values[group[rows]] = target
            samples = Samples(self._stamp[first[:ready]], values, self._log[first[:ready]])
        self._stamp, self._log = self._stamp[~out], self._log[~out]
        self._topic, self._values = self._topic[~out], self._values[~out]
        return samples

    def _groups(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Group of every message, groups counted in the order of their first message, and that message."""
        stamp, topic = self._stamp, self._topic
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
