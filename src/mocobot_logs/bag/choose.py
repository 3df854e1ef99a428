"""Which of the built-in maps a bag goes by, where the user names none."""

from __future__ import annotations

from collections.abc import Mapping

from estimator.errors import InputError
from mocobot_logs.bag.look import Look
from mocobot_logs.bag.messages import Topic, listed_names
from mocobot_logs.bag.types import JOINT_STATE, type_name
from mocobot_logs.map.files import builtin_map
from mocobot_logs.map.log_map import LogMap

_MAPS = ("mocobot-ros2", "omnid-ros2")


def choose_map(bag: str, topics: Mapping[str, Topic], look: Look) -> LogMap:
    """The map more of whose joints the first robot has.

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
