"""A look at the first messages of a bag: joints' names and stamps, before anything is decided."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from mocobot_logs.bag.cdr import CdrReader, Selector
from mocobot_logs.bag.messages import Messages
from mocobot_logs.bag.storage.files import BagFiles
from mocobot_logs.bag.types import JOINT_STATE, message_type
from mocobot_logs.log import Stamps

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
