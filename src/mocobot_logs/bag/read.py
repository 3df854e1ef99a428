"""A look at the first messages of a bag: joints' names and stamps, and which built-in map suits them.

Rows of one robot whose channels come from several topics: the fastest topic sets the rows.

At its stamps, messages of the other topics with the same stamp are taken bit for bit. Where there is none, a topic is
interpolated by the cubic through two samples on either side: of a sine sampled at 100 Hz it misses 4e-7 of the
amplitude at 1 Hz and 2.3e-4 at 5 Hz (3/128 of the fourth power of the phase from sample to sample). Nothing is thinned
out here, so nothing aliases. There is no row where a topic has no samples: before its first, after its last, and where
it has a gap.

ROS 2 bags as logs, without ROS: rosbag2 folders or single files, MCAP or SQLite, CDR messages.

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
from mocobot_logs.bag.cdr import (
    JOINT_STATE,
    STRING,
    CdrReader,
    MessageType,
    Selector,
    message_type,
    string_of,
    type_name,
)
from mocobot_logs.bag.files import BagFiles
from mocobot_logs.bag.messages import Messages, Topic, listed, listed_names, printable
from mocobot_logs.log import NS, REF, Array, Level, Samples, Stamps
from mocobot_logs.maps import ChannelMap, LogMap, builtin_map

_MAPS = ("mocobot-ros2", "omnid-ros2")
STAMPS = 1000
"""So many stamps of a topic are looked at."""
_ENOUGH_BLOCKS = 64
"""After so many blocks those stamps will do that were found."""
_NAMES_BYTES = 64 << 10  # several publishers may have a part of the joints each


class Look:
    """What the first messages of a bag's topics say."""

    def __init__(self, bag: str, files: BagFiles) -> None:
        """Take the bag; nothing is read yet.

        Args:
            bag: what messages call the bag.
            files: its files.
        """
        self._bag, self._files = bag, files
        self._joints: dict[str, tuple[str, ...]] = {}
        self._stamps: dict[tuple[str, str], Stamps] = {}

    def first(self, topic: str, block_bytes: int) -> Messages | None:
        """The first messages of a topic, of about so many bytes; None if there are none.

        Raises:
            InputError: the bag is damaged.
        """
        if not self._files.has_messages(topic):
            return None
        found = self._files.blocks((topic,), lambda _: None, block_bytes)
        return next((block[topic] for block in found), None)

    def joints(self, topic: str) -> tuple[str, ...]:
        """Joints in the first messages of a topic, none if they are no joint states.

        Raises:
            InputError: the bag is damaged, or does not define the type.
        """
        if topic not in self._joints:
            kind = message_type(self._files.topics[topic], self._bag)
            reader = CdrReader(kind, [Selector("position", "")], stamp=False)
            if kind.name == JOINT_STATE:
                kind.require_joints("position")
                if (messages := self.first(topic, _NAMES_BYTES)) is not None:
                    reader.read(messages)
            self._joints[topic] = tuple(reader.joints)
        return self._joints[topic]

    def stamps(self, topics: Sequence[str], clock: Literal["header", "log"]) -> dict[str, Stamps]:
        """Stamps of the first messages of some topics [ns], with a single look at the bag.

        Raises:
            InputError: the bag is damaged, or messages have no stamps.
        """
        missing = [topic for topic in topics if (topic, clock) not in self._stamps]
        readers = {
            t: CdrReader(message_type(self._files.topics[t], self._bag), (), clock == "header")
            for t in missing
        }
        found: dict[str, list[Stamps]] = {topic: [np.empty(0, np.int64)] for topic in missing}
        wanted = tuple(topic for topic in missing if self._files.has_messages(topic))
        looked_at = self._files.blocks(wanted, lambda _: None) if wanted else ()
        for number, block in enumerate(looked_at, 1):
            for topic, messages in block.items():
                stamps = readers[topic].read(messages)[0] if clock == "header" else messages.log_ns
                found[topic].append(stamps)
            enough = STAMPS if number < _ENOUGH_BLOCKS else 1
            if all(sum(map(len, found[topic])) >= enough for topic in wanted):
                break
        for topic, parts in found.items():
            self._stamps[topic, clock] = np.concatenate(parts)[:STAMPS]
        return {topic: self._stamps[topic, clock] for topic in topics}


def choose_map(bag: str, topics: Mapping[str, Topic], look: Look) -> LogMap:
    """The built-in map more of whose joints the first robot has.

    Args:
        bag: what messages call the bag.
        topics: its topics.
        look: its first messages.

    Raises:
        InputError: the bag is damaged, or the joints are neither map's.
    """
    maps = [builtin_map(name) for name in _MAPS]
    topic = maps[0].channels(1)["theta_z"].topic or ""
    if topic not in topics or type_name(topics[topic]) != JOINT_STATE:
        return maps[-1]  # what is missing by it is said where it is used
    there = look.joints(topic)
    if not there:
        raise InputError(f"{bag}: topic {topic} has no message with a joint, so nothing says what was logged")
    wanted = [
        list(dict.fromkeys(c.joint for c in m.channels(1).values() if c.joint is not None)) for m in maps
    ]
    found = [sum(joint in there for joint in joints) for joints in wanted]
    if found[0] == found[1]:
        known = " nor ".join(f"{', '.join(j)} ({m.name})" for j, m in zip(wanted, maps, strict=True))
        raise InputError(
            f"{bag}: the joints of topic {topic} are {listed_names(there)}, neither {known}; a map says which is which"
        )
    return maps[0] if found[0] > found[1] else maps[1]


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
