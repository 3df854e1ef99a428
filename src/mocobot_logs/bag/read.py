"""ROS 2 bags as logs, without ROS: rosbag2 folders or single files, MCAP or SQLite, CDR messages.

Channels are found by a map: a topic and a joint of its sensor_msgs/msg/JointState, or a dotted path in any other
message. Time is the messages' ``header.stamp``, or when they were logged if the map says so. Where channels of one
robot come from several topics, these are brought onto the stamps of the fastest (``align``); commands that a log
may lack are left out if they are not stamped together with the samples. A joint that single messages lack gives NaN.

A bag is read once from front to back, a few MiB at a time, however long it is.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from estimator.errors import InputError
from estimator.recording.metadata import RecordingMetadata
from mocobot_logs.bag.align import Part, RowAligner
from mocobot_logs.bag.cdr import CdrReader, Selector
from mocobot_logs.bag.look import Look, choose_map
from mocobot_logs.bag.messages import Messages, Topic, listed, listed_names, printable
from mocobot_logs.bag.storage.files import BagFiles
from mocobot_logs.bag.types import STRING, MessageType, message_type, string_of, type_name
from mocobot_logs.log import REF, Level, Samples, Stamps
from mocobot_logs.map.log_map import ChannelMap, LogMap

Clock = Literal["header", "log"]

MATCHING = 0.9
"""Share of stamps that two topics have in common from which on they count as stamped together."""


class Single:
    """Rows of a robot with one topic: it has all its channels, in their order."""

    def push(self, parts: Mapping[int, Part]) -> Samples | None:
        """Take a block and return its rows."""
        (part,) = parts.values()
        return Samples(part.stamp_ns, part.values, part.log_ns)

    def finish(self) -> Samples | None:
        """Nothing is left."""
        return None


Joiner = Single | RowAligner
"""Makes rows of the messages of one robot: ``push`` takes a block, topic from 0, and ``finish`` has what is left."""


def agree(look: Look, topics: Sequence[str], clock: Clock) -> bool:
    """Whether the first messages of a robot's topics are stamped together.

    Raises:
        InputError: the bag is damaged, or messages have no stamps.
    """
    first, *others = look.stamps(topics, clock).values()
    return all(_share(stamps, first) >= MATCHING and _share(first, stamps) >= MATCHING for stamps in others)


def _share(some: Stamps, others: Stamps) -> float:
    """Share of some stamps, as far as others cover them, that are among the others."""
    if not len(others):
        return 0.0
    covered = some[(some >= others.min()) & (some <= others.max())]
    return float(np.isin(covered, others).mean()) if len(covered) else 0.0


def make_joiner(
    bag: str, robot: int, topics: Sequence[str], channels: int, look: Look, clock: Clock
) -> Joiner:
    """What makes rows of one robot's messages.

    Args:
        bag: what messages call the bag.
        robot: its number from 1.
        topics: its topics.
        channels: number of channels of a row.
        look: the bag's first messages.
        clock: which stamps count.

    Raises:
        InputError: the bag is damaged, or topics have too few stamps.
    """
    if len(topics) == 1:
        return Single()
    periods = []
    for topic, stamps in look.stamps(topics, clock).items():
        steps = np.diff(stamps)
        if not (steps > 0).any():
            raise InputError(
                f"{bag}: topic {printable(topic)} has too few stamps to be brought onto one time with the other topics "
                f"of robot {robot}"
            )
        periods.append(float(np.median(steps[steps > 0])))
    return RowAligner(f"{bag}: robot {robot}", tuple(map(printable, topics)), tuple(periods), channels)


Names = Callable[[str], tuple[str, ...]]


@dataclass(frozen=True, eq=False)
class Use:
    """What one topic gives to one robot.

    Attributes:
        robot: from 0.
        part: number of the topic among those of the robot, from 0.
        columns: channels, as columns of ``Samples.values``.
        numbers: their places among the topic's selectors.
        maps: how to bring them to SI.
    """

    robot: int
    part: int
    columns: NDArray[np.intp]
    numbers: NDArray[np.intp]
    maps: tuple[ChannelMap, ...]


@dataclass(frozen=True, eq=False)
class TopicPlan:
    """What is read from one topic.

    Attributes:
        kind: type of its messages.
        selectors: the numbers.
        meaning: for each number, channel and robot, for messages.
        uses: where they go.
    """

    kind: MessageType
    selectors: tuple[Selector, ...]
    meaning: tuple[str, ...]
    uses: tuple[Use, ...]


@dataclass(frozen=True, eq=False)
class Plan:
    """What is read from a bag.

    Attributes:
        robots: number of robots.
        channels: columns of ``Samples.values``.
        topics: by name.
        parts: topics of each robot.
    """

    robots: int
    channels: tuple[str, ...]
    topics: Mapping[str, TopicPlan]
    parts: tuple[tuple[str, ...], ...]


def make_plan(
    bag: str, topics: Mapping[str, Topic], log_map: LogMap, names: Names, spoken: Callable[[str], bool]
) -> Plan:
    """Find every channel of every robot.

    Args:
        bag: what messages call the bag.
        topics: its topics.
        log_map: the map.
        names: the joints in the first messages of a topic.
        spoken: whether a topic has any message.

    Raises:
        InputError: the map does not suit the bag.
    """
    log_map.require("topic", "bags")
    log_map.require("field", "bags")
    robots = _count_robots(bag, topics, log_map, names)
    maps = [log_map.channels(robot) for robot in range(1, robots + 1)]
    channels = log_map.required
    if log_map.has_commands(robots, lambda c: (c.topic or "") in topics and spoken(c.topic or "")):
        channels += REF
    selected: dict[str, dict[Selector, str]] = {}
    for robot, channel_maps in enumerate(maps, 1):
        for name in channels:
            channel, meaning = channel_maps[name], log_map.meaning(name, robot)
            topic = channel.topic or ""
            if topic not in topics:
                raise InputError(f"{bag}: {_missing(topic, meaning, topics, log_map)}")
            known = selected.setdefault(topic, {})
            selector = Selector(channel.field or "", channel.joint)
            if selector in known:
                raise InputError(
                    f"{bag}: by map {log_map.name}, {known[selector]} and {meaning} are the same number of topic "
                    f"{printable(topic)}; every channel needs its own"
                )
            known[selector] = meaning
    plans = {}
    own = [tuple(dict.fromkeys(m[name].topic or "" for name in channels)) for m in maps]
    for topic, meanings in selected.items():
        kind, selectors = message_type(topics[topic], bag), tuple(meanings)
        _check(kind, selectors, log_map)
        uses = []
        for robot, channel_maps in enumerate(maps):
            columns = [k for k, name in enumerate(channels) if channel_maps[name].topic == topic]
            if columns:
                used = tuple(channel_maps[channels[k]] for k in columns)
                numbers = [selectors.index(Selector(c.field or "", c.joint)) for c in used]
                uses.append(
                    Use(
                        robot,
                        own[robot].index(topic),
                        np.array(columns, np.intp),
                        np.array(numbers, np.intp),
                        used,
                    )
                )
        plans[topic] = TopicPlan(kind, selectors, tuple(meanings.values()), tuple(uses))
    return Plan(robots, channels, plans, tuple(own))


def _check(kind: MessageType, selectors: tuple[Selector, ...], log_map: LogMap) -> None:
    for selector in selectors:
        if selector.joint is None:
            kind.require(selector.field)
        else:
            kind.require_joints(selector.field)
    if log_map.time.clock == "header":
        kind.require_stamp()


def _count_robots(bag: str, topics: Mapping[str, Topic], log_map: LogMap, names: Names) -> int:
    def joints_of(topic: str) -> tuple[str, ...]:
        return names(topic) if topic in topics else ()

    def is_there(robot: int) -> bool:
        channels, others = log_map.channels(robot), log_map.channels(robot + 1)
        for name in log_map.required:
            channel, other = channels[name], others[name]
            # Robots that share a topic are told apart by their joints.
            is_own = channel.topic != other.topic or (
                channel.joint != other.joint and channel.joint in joints_of(channel.topic or "")
            )
            if channel.topic in topics and is_own:
                return True
        return False

    shared = log_map.robots is None and log_map.one_robot_only("topic")
    if shared and log_map.channels(1) != log_map.channels(2):
        raise InputError(
            f"map {log_map.name}: missing key 'robots'; robots that have neither topics nor joints of their own "
            "cannot be counted"
        )
    return log_map.count_robots(bag, is_there, "topic")


def _missing(topic: str, meaning: str, topics: Mapping[str, Topic], log_map: LogMap) -> str:
    close = difflib.get_close_matches(topic, list(topics)[:1000], n=1, cutoff=0.75)
    hint = f" (did you mean {printable(close[0])}?)" if close else ""
    return f"no topic {topic!r:.80} for {meaning} by map {log_map.name}{hint}; {listed(topics)}"


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
