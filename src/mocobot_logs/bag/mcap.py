"""MCAP files as the storage of a bag (https://mcap.dev/spec).

The file is read once from front to back, chunk by chunk, whatever its index says: the index of a damaged file lies.
Records are parsed by the ``mcap`` library, except for the headers of messages, of which there are millions.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Collection, Iterator
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Schema, Statistics

from estimator.errors import InputError
from mocobot_logs.bag.mcap_runs import HEAD, McapRuns, Run
from mocobot_logs.bag.messages import BLOCK_BYTES, Messages, Topic, check_sizes

DEFINITION_BYTES = 256 << 10
"""Longest definition of a message type that is read [bytes]."""
_MESSAGE_HEAD = struct.Struct("<BQH")  # opcode, length, channel
_MESSAGE = np.dtype(
    [
        ("op", "u1"),
        ("length", "<u8"),
        ("channel", "<u2"),
        ("sequence", "<u4"),
        ("log", "<u8"),
        ("publish", "<u8"),
    ]
)
_INT64 = np.iinfo(np.int64).max


class McapBag:
    """One MCAP file, see ``Storage``."""

    def __init__(self, path: Path, name: str) -> None:
        """Find the topics: in the summary, or in the whole file where there is none.

        Raises:
            InputError: not a complete MCAP file, or a damaged one.
        """
        self.name = name
        self._runs = McapRuns(path, name)
        self.size = self._runs.size
        self._channels: dict[int, Topic] = {}
        self._schemas: dict[int, Schema] = {}
        counts = self._read_summary()
        if not self._channels:
            counts = {}
            for run in self._runs.data(lambda _: None):
                for channel, starts in self._walk(run, None).items():
                    counts[channel] = counts.get(channel, 0) + len(starts)
        self.topics = self._topics(counts)

    def blocks(
        self, topics: Collection[str], advance: Callable[[int], object], block_bytes: int = BLOCK_BYTES
    ) -> Iterator[dict[str, Messages]]:
        """Messages of some topics, see ``Storage.blocks``.

        Raises:
            InputError: the file is damaged.
        """
        for run in self._runs.data(advance, block_bytes):
            by_topic: dict[str, list[int]] = {}
            for channel, starts in self._walk(run, topics).items():
                by_topic.setdefault(self._channels[channel].name, []).extend(starts)
            if by_topic:
                yield {topic: self._messages(run.block, starts, topic) for topic, starts in by_topic.items()}

    def has_messages(self, topic: str) -> bool:
        """Whether there is any message of a topic, as far as the file says."""
        return topic in self.topics and self.topics[topic].count != 0

    def _read_summary(self) -> dict[int, int] | None:
        """Take channels and schemas from the summary; number of messages by channel, if it says so."""
        run, counts, at = self._runs.summary(), None, 0
        while run is not None and at < run.end:
            opcode, content, at = self._record(run, at)
            if opcode == Opcode.STATISTICS:
                counts = dict(self._parse(Statistics, content, run).channel_message_counts)
            else:
                self._define(opcode, content, run)
        return counts

    def _topics(self, counts: dict[int, int] | None) -> dict[str, Topic]:
        topics: dict[str, Topic] = {}
        for channel, topic in self._channels.items():
            known = topics.get(topic.name)
            if known is not None and (known.type, known.encoding) != (topic.type, topic.encoding):
                raise InputError(
                    f"{self.name}: topic {topic.name!r:.80} holds both {known.type!r:.80} and {topic.type!r:.80}"
                )
            before = 0 if known is None or known.count is None else known.count
            count = None if counts is None else before + counts.get(channel, 0)
            topics[topic.name] = Topic(
                topic.name, topic.type, topic.encoding, topic.definition_format, topic.definition, count
            )
        return topics

    def _walk(self, run: Run, topics: Collection[str] | None) -> dict[int, list[int]]:
        """Where the messages of a run are, by channel, of some topics or of all."""
        wanted: dict[int, list[int] | None] = {}
        found: dict[int, list[int]] = {}

        def want(channel: int) -> list[int] | None:
            if (topic := self._channels.get(channel)) is None:
                raise self._runs.damaged(
                    run.offset, f"a message of channel {channel}, which was not announced"
                )
            wanted[channel] = (
                found.setdefault(channel, []) if topics is None or topic.name in topics else None
            )
            return wanted[channel]

        at, head, block, is_message = 0, _MESSAGE_HEAD.unpack_from, run.block, int(Opcode.MESSAGE)
        last = run.end - _MESSAGE.itemsize
        while at < run.end:
            if at <= last:
                opcode, length, channel = head(block, at)
                if opcode == is_message:
                    starts = wanted[channel] if channel in wanted else want(channel)
                    if starts is not None:
                        starts.append(at)
                    at += 9 + length
                    continue
            opcode, content, at = self._record(run, at)
            self._define(opcode, content, run)
        if at != run.end:
            raise self._runs.damaged(run.offset, "a message is longer than what holds it")
        return {channel: starts for channel, starts in found.items() if starts}

    def _record(self, run: Run, at: int) -> tuple[int, bytes, int]:
        """Opcode and content of one record other than a message, and where the next one begins."""
        begin = at + HEAD.size
        if begin > run.end:
            raise self._runs.damaged(run.offset, "a record is cut off")
        opcode, length = HEAD.unpack_from(run.block, at)
        if length > run.end - begin:
            raise self._runs.damaged(
                run.offset, f"a record claims {length} bytes, of which {run.end - begin} are there"
            )
        if opcode in (0, Opcode.MESSAGE, Opcode.CHUNK):
            raise self._runs.damaged(
                run.offset, f"a record of kind {opcode} and {length} bytes, which cannot be"
            )
        return opcode, run.block[begin : begin + length], begin + length

    def _define(self, opcode: int, content: bytes, run: Run) -> None:
        """Take note of a schema or a channel; a later one with the same number must be the same."""
        if opcode == Opcode.SCHEMA:
            schema = self._parse(Schema, content, run)
            if self._schemas.setdefault(schema.id, schema) != schema:
                raise self._runs.damaged(run.offset, f"schema {schema.id} is defined twice")
        elif opcode == Opcode.CHANNEL:
            channel = self._parse(Channel, content, run)
            schema = self._schemas.get(channel.schema_id)
            if schema is None and channel.schema_id:
                raise self._runs.damaged(
                    run.offset, f"channel {channel.id} has schema {channel.schema_id}, which is missing"
                )
            topic = self._topic(channel, schema)
            if self._channels.setdefault(channel.id, topic) != topic:
                raise self._runs.damaged(run.offset, f"channel {channel.id} is defined twice")

    def _topic(self, channel: Channel, schema: Schema | None) -> Topic:
        if schema is None:
            return Topic(channel.topic, "", channel.message_encoding)
        text = schema.data.decode(errors="replace") if len(schema.data) <= DEFINITION_BYTES else ""
        return Topic(channel.topic, schema.name, channel.message_encoding, schema.encoding, text)

    def _parse(self, kind: Any, content: bytes, run: Run) -> Any:
        try:
            return kind.read(ReadDataStream(BytesIO(content)))
        except Exception as error:  # struct.error, UnicodeDecodeError, McapError and what else damage brings
            raise self._runs.damaged(run.offset, f"its {kind.__name__} record is not readable") from error

    def _messages(self, block: bytes, starts: list[int], topic: str) -> Messages:
        start = np.array(starts, np.int64)
        start.sort()  # several publishers of one topic have a channel each
        windows = np.lib.stride_tricks.sliding_window_view(np.frombuffer(block, np.uint8), _MESSAGE.itemsize)
        heads = np.ascontiguousarray(windows[start]).view(_MESSAGE)[:, 0]
        size = heads["length"].astype(np.int64) - (_MESSAGE.itemsize - HEAD.size)
        if size.min() < 0:
            raise InputError(
                f"{self.name}: damaged, a message of topic {topic!r:.80} is shorter than its header"
            )
        check_sizes(size, f"{self.name}: topic {topic!r:.80}")
        if heads["log"].max() > _INT64:
            raise InputError(
                f"{self.name}: damaged, a message of topic {topic!r:.80} was logged after the year 2262"
            )
        return Messages(block, start + _MESSAGE.itemsize, size, heads["log"].astype(np.int64))
