"""From a map to a bag's topics: which number of which message is which channel of which robot."""

import difflib
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimator.errors import InputError
from mocobot_logs.bag.cdr import Selector
from mocobot_logs.bag.messages import Topic, listed, printable
from mocobot_logs.bag.types import MessageType, message_type
from mocobot_logs.log import REF
from mocobot_logs.map.log_map import ChannelMap, LogMap

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
