"""ROS 2 bags as logs, without ROS: rosbag2 folders or single files, MCAP or SQLite, CDR messages.

Channels are found by a map: a topic and a joint of its sensor_msgs/msg/JointState, or a dotted path in any other
message. Time is the messages' ``header.stamp``, or when they were logged if the map says so. Channels of one robot may
come from several topics; messages with the same stamp are one sample then. A joint that single messages lack gives NaN.

A bag is read once from front to back, a few MiB at a time, however long it is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from estimator.errors import InputError
from estimator.recording_metadata import RecordingMetadata
from mocobot_logs.bag_cdr import CdrReader, Selector
from mocobot_logs.bag_files import BagFiles, is_bag, open_files
from mocobot_logs.bag_messages import MESSAGE_BYTES, Messages, joined, merged_topics, printable
from mocobot_logs.bag_plan import Plan, TopicPlan, plan
from mocobot_logs.bag_rows import Part, RowJoiner
from mocobot_logs.bag_types import JOINT_STATE, STRING, message_type, string_of, type_name
from mocobot_logs.bag_unpack import UnpackError, unpack_message
from mocobot_logs.log import Level, Samples, Stamps
from mocobot_logs.log_map import LogMap
from mocobot_logs.maps import builtin_map

__all__ = ["METADATA_TOPIC", "BagSource", "is_bag", "open_bag"]

METADATA_TOPIC = "/mocobot/metadata"
"""One std_msgs/msg/String with the metadata of the recording that a bag was written from."""
ENOUGH = 10_000
"""Messages of a topic after which what none of them had is taken for missing; an hour need not be read for that."""
_OWN_MAPS = ("mocobot-ros2", "omnid-ros2")


def open_bag(path: Path, log_map: LogMap | None) -> BagSource:
    """Open a bag: find its topics, the robots and the channels.

    Args:
        path: a folder with ``metadata.yaml``, or a single .mcap or .db3 file.
        log_map: the map, or None to choose between ``mocobot-ros2`` and ``omnid-ros2`` by the joints' names.

    Raises:
        InputError: there is no bag, it is damaged, or it does not hold what the map says.
    """
    return BagSource(Path(path), log_map)


class BagSource:
    """A bag as a ``LogSource``."""

    def __init__(self, path: Path, log_map: LogMap | None) -> None:
        """See ``open_bag``.

        Raises:
            InputError: see ``open_bag``.
        """
        self.name = str(path)
        self._files = open_files(path)
        self._topics = merged_topics(self._files.storages)
        self._joints: dict[str, tuple[str, ...]] = {}
        self._map = log_map if log_map is not None else self._choose_map()
        self._plan: Plan = plan(self.name, self._topics, self._map, self._names, self._has_messages)
        self.level: Level = self._map.level
        self.robots, self.channels = self._plan.robots, self._plan.channels
        self.size = sum(storage.size for storage in self._files.storages)
        self.metadata = self._read_metadata()

    def chunks(self, advance: Callable[[int], object]) -> Iterator[tuple[int, Samples]]:
        """Samples of one robot after the other, see ``LogSource.chunks``.

        Raises:
            InputError: the bag is damaged, a message is not what its type says, or what the map names is in no message.
        """
        clock = self._map.time.clock
        readers = {name: _Reader(topic, clock) for name, topic in self._plan.topics.items()}
        joiners = [RowJoiner(parts, len(self.channels)) if parts > 1 else None for parts in self._plan.parts]
        for block in _blocks(self._files, tuple(readers), advance):
            parts: list[dict[int, Part]] = [{} for _ in range(self.robots)]
            for topic, messages in block.items():
                readers[topic].read(messages, parts)
            for robot, joiner in enumerate(joiners):
                if parts[robot] and (samples := _rows(parts[robot], joiner)) is not None:
                    yield robot, samples
        for robot, joiner in enumerate(joiners):
            if joiner is not None and (samples := joiner.finish()) is not None:
                yield robot, samples
        for reader in readers.values():
            reader.check_end()

    def _has_messages(self, topic: str) -> bool:
        return any(storage.has_messages(topic) for storage in self._files.storages)

    def _names(self, topic: str) -> tuple[str, ...]:
        """Joints in the first messages of a topic, none if they are no joint states."""
        if topic not in self._joints:
            kind = message_type(self._topics[topic], self.name)
            reader = CdrReader(kind, [Selector("position", "")], stamp=False)
            if kind.name == JOINT_STATE and (messages := self._first(topic)) is not None:
                kind.require_joints("position")
                reader.read(messages)
            self._joints[topic] = tuple(reader.joints)
        return self._joints[topic]

    def _first(self, topic: str) -> Messages | None:
        if not self._has_messages(topic):
            return None
        return next((block[topic] for block in _blocks(self._files, (topic,), lambda _: None)), None)

    def _choose_map(self) -> LogMap:
        """The built-in map more of whose joints are there; commands do not count."""
        maps = [builtin_map(name) for name in _OWN_MAPS]
        topic = maps[0].channels(1)["theta_z"].topic or ""
        if topic not in self._topics or type_name(self._topics[topic]) != JOINT_STATE:
            return maps[-1]  # whose error lists the topics
        there, wanted = self._names(topic), []
        for log_map in maps:
            channels = log_map.channels(1).values()
            wanted.append(list(dict.fromkeys(c.joint for c in channels if c.joint is not None)))
        if not self._joints[topic]:
            raise InputError(
                f"{self.name}: topic {topic} has no message with a joint, so nothing says what is logged"
            )
        found = [sum(joint in there for joint in joints) for joints in wanted]
        if found[0] == found[1]:
            known = " nor ".join(f"{', '.join(j)} ({m.name})" for j, m in zip(wanted, maps, strict=True))
            raise InputError(
                f"{self.name}: the joints of topic {topic} are {_some(there)}, neither {known}; write a map of them"
            )
        return maps[0] if found[0] > found[1] else maps[1]

    def _read_metadata(self) -> RecordingMetadata | None:
        topic = self._topics.get(METADATA_TOPIC)
        if topic is None or type_name(topic) != STRING or (messages := self._first(METADATA_TOPIC)) is None:
            return None
        where = f"{self.name}: {METADATA_TOPIC}"
        metadata = RecordingMetadata.from_json(string_of(messages[0], where), where)
        if metadata.robots != self.robots:
            raise InputError(f"{where}: robots is {metadata.robots}, but the bag has topics of {self.robots}")
        return metadata


class _Reader:
    """Reads one topic and finds out what none of its messages had."""

    def __init__(self, topic: TopicPlan, clock: str) -> None:
        self._topic, self._clock = topic, clock
        self._cdr = CdrReader(topic.kind, topic.selectors, stamp=clock == "header")
        self._stamped = clock == "log"

    def read(self, messages: Messages, parts: list[dict[int, Part]]) -> None:
        """Messages of a block, into the parts of the robots."""
        stamps, numbers = self._cdr.read(messages)
        stamps: Stamps = stamps if self._clock == "header" else messages.log_ns
        self._stamped = self._stamped or bool(stamps.any())
        if self._cdr.count >= ENOUGH:
            self._check(f"none of the first {self._cdr.count} messages")
        for use in self._topic.uses:
            values = np.empty((len(stamps), len(use.columns)))
            with np.errstate(
                over="ignore", invalid="ignore"
            ):  # what is wrong with a value is not for the reader
                for k, channel in enumerate(use.maps):
                    values[:, k] = channel.apply(numbers[:, use.numbers[k]])
            parts[use.robot][use.part] = Part(stamps, messages.log_ns, messages.order, use.columns, values)

    def check_end(self) -> None:
        """Raise ``InputError`` if there was no message, or something was in none of them."""
        if not self._cdr.count:
            raise InputError(f"{self._topic.kind.where} has no messages")
        self._check("no message")

    def _check(self, none: str) -> None:
        where = self._topic.kind.where
        for selector, meaning, lacking in zip(
            self._topic.selectors, self._topic.meaning, self._cdr.lacking, strict=True
        ):
            if lacking is not None and selector.joint is not None:
                raise InputError(
                    f"{where}: joint {selector.joint!r:.60}, wanted for {meaning}, {lacking} in {none}; the joints "
                    f"there are {_some(tuple(self._cdr.joints))}"
                )
            if lacking is not None:
                raise InputError(
                    f"{where}: {selector.field!r:.60}, wanted for {meaning}, {lacking} in {none}"
                )
        if not self._stamped:
            raise InputError(
                f"{where}: {none} has a header stamp other than zero; with clock = 'log' in the map's [time], the "
                "recorder's clock is taken"
            )


def _blocks(
    files: BagFiles, topics: tuple[str, ...], advance: Callable[[int], object]
) -> Iterator[dict[str, Messages]]:
    """Messages of some topics in all files of a bag, unpacked."""
    for storage in files.storages:
        for block in storage.blocks(topics, advance):
            if files.packed:
                block = {
                    topic: _unpacked(m, f"{storage.name}: topic {topic!r:.80}") for topic, m in block.items()
                }
            yield block


def _unpacked(messages: Messages, where: str) -> Messages:
    try:
        payloads = [unpack_message(messages[k], MESSAGE_BYTES) for k in range(len(messages))]
    except UnpackError as error:
        raise InputError(f"{where}: damaged, a compressed message {error}") from error
    return joined(payloads, messages.log_ns, messages.order, where)


def _rows(parts: dict[int, Part], joiner: RowJoiner | None) -> Samples | None:
    if joiner is not None:
        return joiner.push(parts)
    (part,) = parts.values()
    # The only topic of a robot has all its channels, in their order.
    return Samples(part.stamp_ns, part.values, part.log_ns)


def _some(names: tuple[str, ...]) -> str:
    return ", ".join(map(printable, names[:20])) + (", ..." if len(names) > 20 else "") if names else "none"
