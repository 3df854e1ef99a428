"""From a map to a bag's topics: which number of which message is which channel of which robot."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimator.errors import InputError
from mocobot_logs.bag.cdr import Selector
from mocobot_logs.bag.messages import Topic, listed, printable
from mocobot_logs.bag.types import MessageType, message_type
from mocobot_logs.log import CHANNELS, REF
from mocobot_logs.map.log_map import ChannelMap, LogMap

GAP_OF_ROBOTS = 20
"""So far beyond the last robot found another one is looked for, which would mean that one is missing."""

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
    channels = CHANNELS[log_map.level]
    if _has_commands(log_map, maps, lambda topic: topic in topics and spoken(topic)):
        channels += REF
    selected: dict[str, dict[Selector, str]] = {}
    for robot, channel_maps in enumerate(maps, 1):
        for name in channels:
            channel, meaning = channel_maps[name], f"{name} of robot {robot}"
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
    if log_map.robots is not None:
        return log_map.robots

    def joints_of(topic: str) -> tuple[str, ...]:
        return names(topic) if topic in topics else ()

    def is_there(robot: int) -> bool:
        channels, others = log_map.channels(robot), log_map.channels(robot + 1)
        for name in CHANNELS[log_map.level]:
            channel, other = channels[name], others[name]
            # Robots that share a topic are told apart by their joints.
            is_own = channel.topic != other.topic or (
                channel.joint != other.joint and channel.joint in joints_of(channel.topic or "")
            )
            if channel.topic in topics and is_own:
                return True
        return False

    if log_map.one_robot_only("topic"):
        if log_map.channels(1) != log_map.channels(2):
            raise InputError(
                f"map {log_map.name}: missing key 'robots'; robots that have neither topics nor joints of their own "
                "cannot be counted"
            )
        return 1
    count = 0
    while is_there(count + 1):
        count += 1
    for later in range(count + 2, count + 2 + GAP_OF_ROBOTS):
        if count and is_there(later):
            raise InputError(
                f"{bag}: there are topics of robots {count} and {later}, but none of robot {count + 1}; robots are "
                "counted from 1 without a gap, or set by the key robots in a map"
            )
    return max(count, 1)  # without any robot, the first one's topics are what is missing


def _has_commands(log_map: LogMap, maps: list[dict[str, ChannelMap]], spoken: Callable[[str], bool]) -> bool:
    if REF[0] not in log_map.common:
        return False
    optional = all(log_map.common[name].optional for name in REF)
    return not optional or any(spoken(channels[name].topic or "") for channels in maps for name in REF)


def _missing(topic: str, meaning: str, topics: Mapping[str, Topic], log_map: LogMap) -> str:
    close = difflib.get_close_matches(topic, list(topics)[:1000], n=1, cutoff=0.75)
    hint = f" (did you mean {printable(close[0])}?)" if close else ""
    return f"no topic {topic!r:.80} for {meaning} by map {log_map.name}{hint}; {listed(topics)}"
