"""A look at the first messages of a bag: joints' names and stamps, and which built-in map suits them."""

from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np

from estimator.errors import InputError
from mocobot_logs.bag.cdr import CdrReader, Selector
from mocobot_logs.bag.messages import Messages, Topic, listed_names
from mocobot_logs.bag.storage.files import BagFiles
from mocobot_logs.bag.types import JOINT_STATE, message_type, type_name
from mocobot_logs.log import Stamps
from mocobot_logs.map.files import builtin_map
from mocobot_logs.map.log_map import LogMap

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
