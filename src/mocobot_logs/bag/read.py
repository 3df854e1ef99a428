"""ROS 2 bags as logs, without ROS: rosbag2 folders or single files, MCAP or SQLite, CDR messages.

Channels are found by a map: a topic and a joint of its sensor_msgs/msg/JointState, or a dotted path in any other
message. Time is the messages' ``header.stamp``, or when they were logged if the map says so. Where channels of one
robot come from several topics, these are brought onto the stamps of the fastest (``align``); commands that a log
may lack are left out if they are not stamped together with the samples. A joint that single messages lack gives NaN.

A bag is read once from front to back, a few MiB at a time, however long it is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from estimator.errors import InputError
from estimator.recording.metadata import RecordingMetadata
from mocobot_logs.bag.align import Part
from mocobot_logs.bag.cdr import CdrReader
from mocobot_logs.bag.join import Clock, agree, make_joiner
from mocobot_logs.bag.look import Look, choose_map
from mocobot_logs.bag.messages import Messages, listed_names
from mocobot_logs.bag.plan import Plan, TopicPlan, make_plan
from mocobot_logs.bag.storage.files import BagFiles
from mocobot_logs.bag.types import STRING, string_of, type_name
from mocobot_logs.log import REF, Level, Samples
from mocobot_logs.map.log_map import LogMap

METADATA_TOPIC = "/mocobot/metadata"
"""One std_msgs/msg/String with the metadata of the recording that a bag was written from."""
ENOUGH = 10_000
"""Messages of a topic after which what none of them had is taken for missing; an hour need not be read for that."""


def open_bag(path: Path, log_map: LogMap | None = None) -> BagSource:
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
        self._files = BagFiles(path)
        self._look = Look(self.name, self._files)
        self._map = choose_map(self.name, self._files.topics, self._look) if log_map is None else log_map
        self._clock: Clock = self._map.time.clock
        self._plan = self._make_plan()
        self.level: Level = self._map.level
        self.robots, self.channels = self._plan.robots, self._plan.channels
        self.size = self._files.size
        self.metadata = self._read_metadata()

    def chunks(self, advance: Callable[[int], object]) -> Iterator[tuple[int, Samples]]:
        """Samples of one robot after the other, see ``LogSource.chunks``.

        Raises:
            InputError: the bag is damaged, a message is not what its type says, or what the map names is in no message.
        """
        readers = {name: _Reader(topic, self._clock) for name, topic in self._plan.topics.items()}
        joiners = [
            make_joiner(self.name, robot, topics, len(self.channels), self._look, self._clock)
            for robot, topics in enumerate(self._plan.parts, 1)
        ]
        for block in self._files.blocks(tuple(readers), advance):
            parts: list[dict[int, Part]] = [{} for _ in range(self.robots)]
            for topic, messages in block.items():
                readers[topic].read(messages, parts)
            for robot, joiner in enumerate(joiners):
                if parts[robot] and (samples := joiner.push(parts[robot])) is not None:
                    yield robot, samples
        for robot, joiner in enumerate(joiners):
            if (samples := joiner.finish()) is not None:
                yield robot, samples
        for reader in readers.values():
            reader.check_end()

    def _make_plan(self) -> Plan:
        """The plan; without commands that a log may lack where they are not stamped together with the samples."""
        arguments = self.name, self._files.topics, self._map, self._look.joints
        found = make_plan(*arguments, self._files.has_messages)
        if any(len(topics) > 1 for topics in found.parts):  # all at once: the bag need not be looked at again
            self._look.stamps(tuple(found.topics), self._clock)
        may_lack = found.channels != self._map.required and self._map.common[REF[0]].optional
        if may_lack and not all(agree(self._look, topics, self._clock) for topics in found.parts):
            return make_plan(*arguments, lambda _: False)
        return found

    def _read_metadata(self) -> RecordingMetadata | None:
        topic = self._files.topics.get(METADATA_TOPIC)
        if topic is None or type_name(topic) != STRING:
            return None
        if (messages := self._look.first(METADATA_TOPIC, 1)) is None:
            return None
        where = f"{self.name}: {METADATA_TOPIC}"
        metadata = RecordingMetadata.from_json(string_of(messages[0], where), where)
        if metadata.robots != self.robots:
            raise InputError(f"{where}: robots is {metadata.robots}, but the bag has topics of {self.robots}")
        return metadata


class _Reader:
    """Reads one topic and finds out what none of its messages had."""

    def __init__(self, topic: TopicPlan, clock: Clock) -> None:
        self._topic, self._clock = topic, clock
        self._cdr = CdrReader(topic.kind, topic.selectors, stamp=clock == "header")
        self._stamped = clock == "log"

    def read(self, messages: Messages, parts: list[dict[int, Part]]) -> None:
        """Messages of a block, into the parts of the robots."""
        stamps, numbers = self._cdr.read(messages)
        if self._clock == "log":
            stamps = messages.log_ns
        self._stamped = self._stamped or bool(stamps.any())
        if self._cdr.count >= ENOUGH:
            self._check(f"all of the first {self._cdr.count} messages")
        for use in self._topic.uses:
            values = np.empty((len(stamps), len(use.columns)))
            with np.errstate(
                over="ignore", invalid="ignore"
            ):  # what is wrong with a value is not for the reader
                for k, channel in enumerate(use.maps):
                    values[:, k] = channel.apply(numbers[:, use.numbers[k]])
            parts[use.robot][use.part] = Part(stamps, messages.log_ns, use.columns, values)

    def check_end(self) -> None:
        """Raise ``InputError`` if there was no message, or something was in none of them."""
        if not self._cdr.count:
            raise InputError(f"{self._topic.kind.where} has no messages")
        self._check("every message")

    def _check(self, every: str) -> None:
        where = self._topic.kind.where
        for selector, meaning, lacking in zip(
            self._topic.selectors, self._topic.meaning, self._cdr.lacking, strict=True
        ):
            if lacking is not None and selector.joint is not None:
                raise InputError(
                    f"{where}: joint {selector.joint!r:.60}, wanted for {meaning}, {lacking} in {every}; the joints "
                    f"there are {listed_names(tuple(self._cdr.joints))}"
                )
            if lacking is not None:
                raise InputError(
                    f"{where}: field {selector.field!r:.60}, wanted for {meaning}, {lacking} in {every}"
                )
        if not self._stamped:
            raise InputError(
                f"{where}: the header stamp is zero in {every}; with clock = 'log' in the map's [time], the recorder's "
                "clock is taken"
            )
