"""Read ROS 2 bags as logs, without ROS: rosbag2 folders or single files, MCAP or SQLite, CDR messages.

A map locates each channel: a topic and a joint of its sensor_msgs/msg/JointState, or a dotted path in another message.
Time is ``header.stamp`` or, if the map says so, the time of logging. If a robot's channels come from several topics,
``RowAligner`` brings them onto the stamps of the fastest; so it does if publishers that share a topic each send some of
the joints. Optional commands are left out if their stamps differ from those of the samples. A message without any
wanted joint is no sample. Where the recorder's clock replaces header stamps that are zero, or messages are left out,
a note says so.

A bag of any length is read once from front to back, a few MiB at a time.
"""

import difflib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from estimator.errors import InputError
from estimator.recording.metadata import RecordingMetadata
from mocobot_logs.bag.cdr import (
    EMPTY,
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
from mocobot_logs.bag.storage import BLOCK_BYTES, Messages, listed, listed_names, printable
from mocobot_logs.log import NS, REF, Array, Level, Samples, Stamps, joined, rows_of
from mocobot_logs.maps import ChannelMap, LogMap, builtin_map
from mocobot_logs.resample_filter import held_means

MAX_GAP_NS = 50_000_000
"""Longest time without samples of a topic, beyond its period, that is interpolated [ns]."""
HELD = 1 << 16  # largest number of messages of a topic that wait for those of another topic
_AT_ONCE = 4096
_SAME = 1.25  # ratio below which periods of topics count as equal
_CROWDED = 0.25  # of a period: differences between closer samples are only noise


class RowAligner:
    """Brings several topics of one robot onto the stamps of the fastest topic.

    Messages of other topics with the same stamp are copied bit for bit. At other stamps, a topic is interpolated by
    the cubic through two samples on either side. Its relative error for a sine is 3/128 of the fourth power of the
    phase per sample. At 100 Hz this is 4e-7 for 1 Hz and 2.3e-4 for 5 Hz. Nothing is decimated, so nothing aliases.
    There are no rows before a topic's first sample, after its last, or in its gaps.

    Channels that are held, such as commands, are not interpolated: a row has the mean of what holds until the next row.
    A topic of such channels alone does not set the rows, and may pause or end.
    """

    def __init__(
        self,
        where: str,
        names: Sequence[str],
        periods_ns: Sequence[float],
        columns: Sequence[NDArray[np.intp]],
        held: NDArray[np.bool_] | None = None,
    ) -> None:
        """Initialise without samples.

        Args:
            where, names: names of the robot and of its topics in messages.
            periods_ns: median periods of the topics [ns]; the first that is close to the shortest sets the rows.
            columns: columns of a row that each topic fills.
            held: whether each column of a row is held; None if none is.
        """
        held = np.zeros(sum(map(len, columns)), dtype=bool) if held is None else held
        self._where, self._names, self._periods, self._columns = where, names, periods_ns, columns
        self._held = [held[each] for each in columns]
        measured = [k for k, each in enumerate(self._held) if not each.all()] or [*range(len(columns))]
        least = min(periods_ns[k] for k in measured)
        self._leader = next(k for k in measured if periods_ns[k] <= _SAME * least)
        self._topics = [joined([], len(each)) for each in columns]

    def push(self, parts: Mapping[int, Samples]) -> Samples | None:
        """Add a block, messages by topic number from 0, and return the rows that are complete, if any."""
        for number, part in parts.items():
            if number != self._leader:
                self._check(number, part.stamp_ns)
            held = self._topics[number]
            self._topics[number] = joined([held, part], 0) if len(held.stamp_ns) else part
        leader = self._topics[self._leader].stamp_ns
        others = [topic.stamp_ns for k, topic in enumerate(self._topics) if k != self._leader]
        if len(leader) < _AT_ONCE and all(len(stamps) < HELD for stamps in others):
            return None
        # Interpolation needs two samples after every row.
        until = min(int(stamps[-2]) if len(stamps) > 1 else -(1 << 62) for stamps in others)
        later = leader > until
        ready = int(np.argmax(later)) if later.any() else len(leader)
        # What is held is needed until the next row.
        ready = max(ready - any(each.any() for each in self._held), 0)
        return self._rows(max(ready, len(leader) - HELD))

    def finish(self) -> Samples | None:
        return self._rows(len(self._topics[self._leader].stamp_ns))

    def _rows(self, ready: int) -> Samples | None:
        rows = rows_of(self._topics[self._leader], slice(ready))
        until = self._topics[self._leader].stamp_ns[1 : ready + 1]
        until = np.append(until, rows.stamp_ns[len(until) :] + round(self._periods[self._leader]))
        values = np.full((ready, sum(map(len, self._columns))), np.nan)
        values[:, self._columns[self._leader]] = rows.values
        good = np.ones(ready, bool)
        for number, topic in enumerate(self._topics):
            keep = ready
            if number != self._leader:
                values[:, self._columns[number]], near = _interpolated(
                    topic, rows.stamp_ns, self._periods[number]
                )
                if (held := self._held[number]).any() and len(topic.stamp_ns):
                    means = held_means(topic.stamp_ns, topic.values[:, held], rows.stamp_ns, until)
                    values[:, self._columns[number][held]] = means
                    near = rows.stamp_ns >= topic.stamp_ns[0] if held.all() else near
                good &= near
                keep = max(len(topic.stamp_ns) - HELD // 2, 0)
                if ready:  # later rows need two samples before the last row
                    keep = max(keep, int(np.searchsorted(topic.stamp_ns, rows.stamp_ns[-1])) - 2)
            self._topics[number] = rows_of(topic, slice(keep, None))
        if not good.any():
            return None
        return Samples(rows.stamp_ns[good], values[good], None if rows.log_ns is None else rows.log_ns[good])

    def _check(self, number: int, stamp_ns: Stamps) -> None:
        steps = np.diff(np.concatenate([self._topics[number].stamp_ns[-1:], stamp_ns]))
        if len(steps) and steps.min() < 0:
            raise InputError(
                f"{self._where}: the stamps of topic {self._names[number]} run back by {-steps.min() * NS:.9g} s; "
                "topics can be brought together only if their stamps never decrease"
            )


def _interpolated(topic: Samples, at_ns: Stamps, period_ns: float) -> tuple[Array, NDArray[np.bool_]]:
    """Return interpolated values at some stamps, and which stamps have close enough samples on both sides."""
    fresh = np.ones(len(topic.stamp_ns), bool)
    fresh[1:] = topic.stamp_ns[1:] > topic.stamp_ns[:-1]  # drop repeated stamps
    stamp, values = topic.stamp_ns[fresh], topic.values[fresh]
    if len(stamp) < 2:
        return np.full((len(at_ns), values.shape[1]), np.nan), np.zeros(len(at_ns), bool)
    after = np.clip(np.searchsorted(stamp, at_ns), 1, len(stamp) - 1)
    nodes = after[:, None] + np.arange(-2, 2)
    cubic = (nodes[:, 0] >= 0) & (nodes[:, -1] < len(stamp))
    nodes = np.clip(nodes, 0, len(stamp) - 1)
    time = (stamp[nodes] - at_ns[:, None]) / period_ns  # differences first: stamps lose precision as floats
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
    # NaN times zero weight would be NaN: use 0 for samples without weight.
    return np.einsum("qn,qnc->qc", weights, np.where(weights[..., None] != 0.0, values[nodes], 0.0)), good


def _lagrange(time: Array) -> Array:
    """Return Lagrange weights of samples at ``time`` (q, n) for the value at 0."""
    weights = np.ones_like(time)
    for k in range(time.shape[1]):
        for j in range(time.shape[1]):
            if j != k:
                weights[:, k] *= time[:, j] / (time[:, j] - time[:, k])
    return weights


Clock = Literal["header", "log"]

METADATA_TOPIC = "/mocobot/metadata"
"""Topic of one std_msgs/msg/String with the metadata of the recording that a bag was written from."""
MATCHING = 0.9  # smallest share of common stamps at which two topics count as stamped together
ENOUGH = 10_000
"""Number of messages after which a field or joint that none of them had counts as missing; saves reading long bags."""
LOOKED = 100_000  # number of messages that a draft looks at
STAMPS = 1000  # number of stamps per topic that are read before the bag itself
_ENOUGH_BLOCKS = 64  # number of blocks after which the stamps found so far must suffice
_EARLY_NS = 1_000_000_000
"""A clock that was just set to zero, as of a simulation, is before this; a stamp of zero counts then [ns]."""
_MAPS = ("mocobot-ros2", "omnid-ros2")


class Look:
    """Reads the first messages of a bag's topics."""

    def __init__(self, path: Path) -> None:
        """Open the bag's files; no message is read yet."""
        self._bag, self.files = str(path), BagFiles(path)
        self.types = {topic: type_name(told) for topic, told in self.files.topics.items()}
        self._named: dict[str, CdrReader] = {}
        self._stamps: dict[tuple[str, str], Stamps] = {}

    def kind(self, topic: str) -> MessageType:
        """Return the type of a topic's messages."""
        return message_type(self.files.topics[topic], self._bag)

    def first(self, topic: str, block_bytes: int) -> Messages | None:
        """Return the first messages of a topic, about ``block_bytes`` bytes, or None if it has none."""
        return next((block[topic] for block in self._blocks((topic,), block_bytes)), None)

    def _blocks(self, topics: Sequence[str], block_bytes: int = BLOCK_BYTES) -> Iterator[dict[str, Messages]]:
        there = tuple(filter(self.files.has_messages, topics))
        return self.files.blocks(there, lambda _: None, block_bytes) if there else iter(())

    def _read(
        self, topic: str, places: Sequence[tuple[str, str | None]], clock: Clock | None, most: int = STAMPS
    ) -> tuple[CdrReader, Stamps, Array, NDArray[np.bool_]]:
        """Read numbers from at least ``most`` of the first messages of a topic, if there are so many.

        Several publishers may each send some of the joints, and one of them may start late. Returns the reader, stamps
        [ns], shape (q,), numbers, NaN where lacking, and whether a message names each joint, shape (q, C).
        """
        reader = CdrReader(self.kind(topic), [Selector(*place) for place in places], clock == "header")
        found = [(np.empty(0, np.int64), np.empty((0, len(places))), np.empty((0, len(places)), bool))]
        for block in islice(self._blocks((topic,)), _ENOUGH_BLOCKS if most == STAMPS else None):
            stamps, values, named = reader.read_named(block[topic])
            found.append((stamps if clock == "header" else block[topic].log_ns, values, named))
            if reader.count >= most:
                break
        stamps, values, named = (np.concatenate(each) for each in zip(*found, strict=True))
        return reader, stamps, values, named

    def _names(self, topic: str) -> CdrReader | None:
        """Return what has read the joints of a topic, None if it has no joint states or does not exist."""
        if self.types.get(topic) == JOINT_STATE and topic not in self._named:
            self.kind(topic).require_joints("position")
            self._named[topic] = self._read(topic, [("position", "")], None)[0]
        return self._named.get(topic)

    def joints(self, topic: str) -> tuple[str, ...]:
        """Return the joints in the first messages of a topic, empty if it has no joint states or does not exist."""
        return () if (reader := self._names(topic)) is None else tuple(reader.joints)

    def together(self, topic: str, joints: Sequence[str]) -> list[set[str]]:
        """Return the joints of a topic in groups, one for each publisher that sends joints of its own."""
        groups: list[set[str]] = []
        reader = self._names(topic)
        for sent in () if reader is None else reader.senders:
            mine = set(joints) & sent
            groups = [*(g for g in groups if not g & mine), mine.union(*(g for g in groups if g & mine))]
        return sorted(filter(None, groups), key=lambda group: min(map(joints.index, group)))

    def sent(self, topic: str, joints: Sequence[str], clock: Clock) -> Stamps:
        """Return stamps [ns] of the first messages of a topic that name some of the joints."""
        _, stamps, _, named = self._read(topic, [("position", joint) for joint in joints], clock)
        return stamps[named.any(axis=1)]

    def numbers(self, topic: str, joints: Sequence[str], field: str) -> dict[str, tuple[Array, str]]:
        """Return the finite values of a field in the first messages by joint, and why there are none, if so."""
        reader, _, values, _ = self._read(topic, [(field, joint) for joint in joints], None)
        found = {}
        for joint, x, lacking in zip(joints, values.T, reader.lacking, strict=True):
            why = f"{field} is NaN" if lacking is None else lacking.partition(": ")[2]
            why = f"{field} is empty" if lacking is not None and lacking.startswith(EMPTY) else why
            found[joint] = x[np.isfinite(x)], f"{why} in the first {reader.count} messages"
        return found

    def series(
        self, topic: str, places: Sequence[tuple[str, str | None]], clock: Clock
    ) -> tuple[Stamps, Array]:
        """Return stamps [ns], shape (q,), and numbers, shape (q, C), in a topic's first messages, NaN where lacking.

        ``places`` are fields, each with the joint whose number it is, or None.
        """
        return self._read(topic, places, clock, LOOKED)[1:3]

    def joint_names(self, topic: str) -> tuple[str, ...]:
        """Return the texts of ``joint_names`` in the first message of a topic, empty if there are none."""
        reader = CdrReader(self.kind(topic), [Selector("", "")], stamp=False)
        if (found := self.first(topic, 1)) is not None:
            reader.read(found)
        return tuple(reader.joints)

    def fields(self, topic: str) -> tuple[str, ...]:
        kind = self.kind(topic)
        return tuple(name for name, _ in kind.fields(kind.name))

    def is_stamped(self, topic: str) -> bool:
        """Return whether messages have header stamps, and the first ones are not all zero."""
        try:
            self.kind(topic).require_stamp()
        except InputError:
            return False
        return bool(self.stamps((topic,), "header")[topic].any())

    def stamps(self, topics: Sequence[str], clock: Clock) -> dict[str, Stamps]:
        """Return stamps [ns] of the first messages of some topics, in a single pass over the bag."""
        missing = [topic for topic in topics if (topic, clock) not in self._stamps]
        readers = {topic: CdrReader(self.kind(topic), (), clock == "header") for topic in missing}
        found: dict[str, list[Stamps]] = {topic: [np.empty(0, np.int64)] for topic in missing}
        wanted = tuple(filter(self.files.has_messages, missing))
        for number, block in enumerate(self._blocks(wanted), 1):
            for topic, messages in block.items():
                stamps = readers[topic].read(messages)[0] if clock == "header" else messages.log_ns
                found[topic].append(stamps)
            enough = STAMPS if number < _ENOUGH_BLOCKS else 1
            if all(sum(map(len, found[topic])) >= enough for topic in wanted):
                break
        for topic, parts in found.items():
            self._stamps[topic, clock] = np.concatenate(parts)[:STAMPS]
        return {topic: self._stamps[topic, clock] for topic in topics}

    def agree(self, topics: Sequence[str], clock: Clock) -> bool:
        """Return whether the first messages of some topics are stamped together."""
        first, *others = self.stamps(topics, clock).values()
        return all(_share(each, first) >= MATCHING and _share(first, each) >= MATCHING for each in others)


def _share(some: Stamps, others: Stamps) -> float:
    """Return the share of ``some`` stamps that are among the others, within the time span of the others."""
    if not len(others):
        return 0.0
    covered = some[(some >= others.min()) & (some <= others.max())]
    return float(np.isin(covered, others).mean()) if len(covered) else 0.0


@dataclass(frozen=True, eq=False)
class _Use:
    """The use of one topic for one robot."""

    # robot, part: number of the robot, and of the topic among the robot's topics, from 0
    robot: int
    part: int
    numbers: list[int]  # indices of the channels among the topic's selectors
    maps: tuple[ChannelMap, ...]  # conversions to SI


@dataclass(frozen=True, eq=False)
class _Topic:
    """What to read from one topic."""

    name: str
    kind: MessageType  # type of its messages
    selectors: dict[Selector, str]  # numbers to read, with their meaning (channel and robot)
    optional: set[Selector]  # numbers that all messages may lack
    uses: list[_Use]  # uses by robots


class BagSource:
    """A bag as a ``LogSource``."""

    def __init__(self, path: Path, log_map: LogMap | None) -> None:
        self.name = str(path)
        self._look = Look(path)
        self._files = self._look.files
        self._map = self._choose_map() if log_map is None else log_map
        self._clock: Clock = self._map.time.clock
        self.level: Level = self._map.level
        self._map.require("topic", "bags")
        self._map.require("field", "bags")
        self.robots = self._count_robots()
        self._maps = [self._map.channels(robot) for robot in range(1, self.robots + 1)]
        self.channels = self._map.required
        if self._map.has_commands(self.robots, lambda channel: self._files.has_messages(channel.topic or "")):
            self.channels += REF
        self.notes: list[str] = []
        self._plan()
        self._unset = self._stamps_unset() if self._clock == "header" else set()
        self._clock_notes = len(self.notes)
        if any(len(topics) > 1 for topics in self._parts):  # one pass for all topics
            self._look.stamps(tuple(self._topics), self._clock)
        may_lack = self.channels != self._map.required and self._map.common[REF[0]].optional
        if may_lack and not all(self._look.agree(topics, self._clock) for topics in self._parts):
            self.channels = self._map.required
            self._plan()
        self.size = self._files.size
        self.metadata = self._read_metadata()

    def chunks(self, advance: Callable[[int], object]) -> Iterator[tuple[int, Samples]]:
        readers = {
            name: _Reader(topic, self._clock, unset=name in self._unset)
            for name, topic in self._topics.items()
        }
        aligners = [self._aligner(robot) for robot in range(self.robots)]
        for block in self._files.blocks(tuple(readers), advance):
            parts: list[dict[int, Samples]] = [{} for _ in range(self.robots)]
            for topic, messages in block.items():
                readers[topic].read(messages, parts)
            for robot, (aligner, found) in enumerate(zip(aligners, parts, strict=True)):
                samples = found.get(0) if aligner is None else aligner.push(found) if found else None
                if samples is not None:
                    yield robot, samples
        for robot, aligner in enumerate(aligners):
            if aligner is not None and (samples := aligner.finish()) is not None:
                yield robot, samples
        for reader in readers.values():
            reader.check_end()
        self.notes[self._clock_notes :] = [*(note for reader in readers.values() for note in reader.notes())]

    def _stamps_unset(self) -> set[str]:
        """Return the topics whose stamps of zero are none; take the recorder's clock if a topic has no others."""
        unset = set()
        for topic, stamps in self._look.stamps(tuple(self._topics), self._clock).items():
            later = stamps[stamps != 0]
            if len(later) and later[0] > _EARLY_NS:
                unset.add(topic)
            elif len(stamps) > 1 and not len(later):
                self._clock = "log"
                self.notes.append(
                    f"The header stamps of topic {printable(topic)} are zero, so the recorder's time is taken."
                )
        return unset

    def _choose_map(self) -> LogMap:
        """Return the built-in map that names more of the first robot's joints."""
        maps = [builtin_map(name) for name in _MAPS]
        topic = maps[0].channels(1)["theta_z"].topic or ""
        if topic not in self._files.topics or type_name(self._files.topics[topic]) != JOINT_STATE:
            return maps[-1]  # a later check reports what is missing
        there = self._look.joints(topic)
        if not there:
            raise InputError(
                f"{self.name}: topic {topic} has no message with a joint, so nothing says what was logged"
            )
        wanted = [list(dict.fromkeys(c.joint for c in m.channels(1).values() if c.joint)) for m in maps]
        found = [sum(joint in there for joint in joints) for joints in wanted]
        if found[0] == found[1]:
            known = " nor ".join(f"{', '.join(j)} ({m.name})" for j, m in zip(wanted, maps, strict=True))
            raise InputError(
                f"{self.name}: the joints of topic {topic} are {listed_names(there)}, neither {known}; a map says "
                "which is which"
            )
        return maps[0] if found[0] > found[1] else maps[1]

    def _count_robots(self) -> int:
        log_map = self._map

        def is_there(robot: int) -> bool:
            channels, others = log_map.channels(robot), log_map.channels(robot + 1)
            for name in log_map.required:
                channel, other = channels[name], others[name]
                # Joints distinguish robots that share a topic.
                is_own = channel.topic != other.topic or (
                    channel.joint != other.joint and channel.joint in self._look.joints(channel.topic or "")
                )
                if channel.topic in self._files.topics and is_own:
                    return True
            return False

        shared = log_map.robots is None and log_map.one_robot_only("topic")
        if shared and log_map.channels(1) != log_map.channels(2):
            raise InputError(
                f"map {log_map.name}: missing key 'robots'; robots that have neither topics nor joints of their own "
                "cannot be counted"
            )
        return log_map.count_robots(self.name, is_there, "topic")

    def _plan(self) -> None:
        """Locate every channel of every robot: topics of each robot, columns of each topic, selectors of each
        message."""
        selected: dict[str, dict[Selector, str]] = {}
        optional: set[Selector] = set()
        for robot, channel_maps in enumerate(self._maps, 1):
            for name in self.channels:
                channel, meaning = channel_maps[name], self._map.meaning(name, robot)
                topic = channel.topic or ""
                if topic not in self._files.topics:
                    raise InputError(self._missing(topic, meaning))
                known = selected.setdefault(topic, {})
                selector = Selector(channel.field or "", channel.joint)
                if selector in known:
                    raise InputError(
                        f"{self.name}: by map {self._map.name}, {known[selector]} and {meaning} are the same number of "
                        f"topic {printable(topic)}; every channel needs its own"
                    )
                known[selector] = meaning
                optional |= {selector} if channel.optional else set()
        self._topics = {
            topic: _Topic(topic, self._checked_type(topic, meanings), meanings, optional & set(meanings), [])
            for topic, meanings in selected.items()
        }
        self._parts: list[tuple[str, ...]] = []
        self._columns: list[list[NDArray[np.intp]]] = []
        for robot, maps in enumerate(self._maps):
            topics = dict.fromkeys(maps[name].topic or "" for name in self.channels)
            own = [(topic, columns) for topic in topics for columns in self._sent_together(topic, maps)]
            self._parts.append(tuple(topic for topic, _ in own))
            self._columns.append([np.array(columns, np.intp) for _, columns in own])
            for part, (topic, columns) in enumerate(own):
                used = tuple(maps[self.channels[k]] for k in columns)
                places = list(self._topics[topic].selectors)
                numbers = [places.index(Selector(c.field or "", c.joint)) for c in used]
                self._topics[topic].uses.append(_Use(robot, part, numbers, used))

    def _sent_together(self, topic: str, maps: Mapping[str, ChannelMap]) -> list[list[int]]:
        """Return a robot's columns of a topic in groups that come in the same messages."""
        columns = [k for k, name in enumerate(self.channels) if maps[name].topic == topic]
        joints = [maps[self.channels[k]].joint or "" for k in columns]
        groups = self._look.together(topic, joints) if any(joints) else []
        at = [next((n for n, group in enumerate(groups) if joint in group), 0) for joint in joints]
        return [[k for k, n in zip(columns, at, strict=True) if n == each] for each in dict.fromkeys(at)]

    def _checked_type(self, topic: str, selectors: Mapping[Selector, str]) -> MessageType:
        kind = message_type(self._files.topics[topic], self.name)
        for selector in selectors:
            if selector.joint is None:
                kind.require(selector.field)
            else:
                kind.require_joints(selector.field)
        if self._clock == "header":
            kind.require_stamp()
        return kind

    def _missing(self, topic: str, meaning: str) -> str:
        topics = self._files.topics
        close = difflib.get_close_matches(topic, list(topics)[:1000], n=1, cutoff=0.75)
        hint = f" (did you mean {printable(close[0])}?)" if close else ""
        where = f"for {meaning} by map {self._map.name}"
        return f"{self.name}: no topic {topic!r:.80} {where}{hint}; {listed(topics)}"

    def _aligner(self, robot: int) -> RowAligner | None:
        """Return the aligner of a robot's topics; a single topic needs none."""
        topics, maps = self._parts[robot], self._maps[robot]
        if len(topics) == 1:
            return None
        periods, every = [], self._look.stamps(topics, self._clock)
        for topic, columns in zip(topics, self._columns[robot], strict=True):
            joints = [maps[self.channels[k]].joint or "" for k in columns]
            stamps = every[topic] if topics.count(topic) == 1 else self._look.sent(topic, joints, self._clock)
            steps = np.diff(stamps)
            if not (steps > 0).any() and not all(maps[self.channels[k]].held for k in columns):
                raise InputError(
                    f"{self.name}: topic {printable(topic)} has too few stamps to be brought onto one time with the "
                    f"other topics of robot {robot + 1}"
                )
            periods.append(float(np.median(steps[steps > 0])) if (steps > 0).any() else np.inf)
        names = tuple(map(printable, topics))
        held = np.array([maps[name].held for name in self.channels], dtype=bool)
        return RowAligner(f"{self.name}: robot {robot + 1}", names, periods, self._columns[robot], held)

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


def open_bag(path: Path, log_map: LogMap | None = None) -> BagSource:
    """Open a folder with ``metadata.yaml``, or a single .mcap or .db3 file.

    Without a map, the joints' names decide between ``mocobot-ros2`` and ``omnid-ros2``.
    """
    return BagSource(Path(path), log_map)


class _Reader:
    """Reads one topic and checks that each selector occurs in some message."""

    def __init__(self, topic: _Topic, clock: Clock, *, unset: bool) -> None:
        """``unset`` tells whether a stamp of zero is none."""
        self._topic, self._clock, self._unset = topic, clock, unset
        self._cdr = CdrReader(topic.kind, tuple(topic.selectors), stamp=clock == "header")
        self._zeros = self._others = 0

    def read(self, messages: Messages, parts: list[dict[int, Samples]]) -> None:
        stamps, numbers, named = self._cdr.read_named(messages)
        if self._clock == "log":
            stamps = messages.log_ns
        stamped = (stamps != 0) | (messages.log_ns < _EARLY_NS) | (not self._unset)
        self._zeros += int(np.sum(~stamped))
        self._others += int(np.sum(~named.any(axis=1)))
        if self._cdr.count >= ENOUGH:
            self._check(f"all of the first {self._cdr.count} messages")
        for use in self._topic.uses:
            values = np.empty((len(stamps), len(use.maps)))
            with np.errstate(over="ignore", invalid="ignore"):  # later stages check the values
                for k, (number, channel) in enumerate(zip(use.numbers, use.maps, strict=True)):
                    values[:, k] = channel.apply(numbers[:, number])
            samples, sent = (
                Samples(stamps, values, messages.log_ns),
                stamped & named[:, use.numbers].any(axis=1),
            )
            if sent.all():
                parts[use.robot][use.part] = samples
            elif sent.any():
                parts[use.robot][use.part] = rows_of(samples, sent)

    def notes(self) -> Iterator[str]:
        """Yield a sentence for each irregularity of the messages."""
        topic = printable(self._topic.name)
        if self._zeros:
            s, are = ("s", "are") if self._zeros > 1 else ("", "is")
            yield f"{self._zeros} header stamp{s} of topic {topic} {are} zero; these messages are left out."
        if self._others:
            yield f"{self._others} of {self._cdr.count} messages of topic {topic} hold other joints alone."
        if self._cdr.unread:
            yield (
                f"Messages of topic {topic} have up to {self._cdr.unread} bytes after their last field, which are not "
                "read."
            )

    def check_end(self) -> None:
        """Refuse a topic without messages, and one that lacks a selected number in every message."""
        if not self._cdr.count:
            raise InputError(f"{self._topic.kind.where} has no messages")
        self._check("every message")

    def _check(self, every: str) -> None:
        where = self._topic.kind.where
        for (selector, meaning), lacking in zip(
            self._topic.selectors.items(), self._cdr.lacking, strict=True
        ):
            if lacking is None or (lacking.startswith(EMPTY) and selector in self._topic.optional):
                continue  # later stages leave an empty channel out
            what, there = f"field {selector.field!r:.60}", ""
            if selector.joint is not None:
                what = f"joint {selector.joint!r:.60}"
                there = f"; the joints there are {listed_names(tuple(self._cdr.joints))}"
            raise InputError(f"{where}: {what}, wanted for {meaning}, {lacking} in {every}{there}")
