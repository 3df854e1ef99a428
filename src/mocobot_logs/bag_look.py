"""A look at the first messages of a bag: joints' names and stamps, before anything is decided."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Literal

import numpy as np

from estimator.errors import InputError
from mocobot_logs.bag_cdr import CdrReader, Selector
from mocobot_logs.bag_files import BagFiles
from mocobot_logs.bag_messages import MESSAGE_BYTES, Messages, Topic, joined
from mocobot_logs.bag_types import JOINT_STATE, message_type
from mocobot_logs.bag_unpack import UnpackError, unpack_message
from mocobot_logs.log import Stamps

STAMPS = 1000
"""So many stamps of a topic are looked at."""


class Look:
    """What the first messages of a bag's topics say."""

    def __init__(self, bag: str, files: BagFiles, topics: Mapping[str, Topic]) -> None:
        """Take the bag; nothing is read yet.

        Args:
            bag: what messages call the bag.
            files: its files.
            topics: its topics.
        """
        self._bag, self._files, self._topics = bag, files, topics
        self._joints: dict[str, tuple[str, ...]] = {}
        self._stamps: dict[tuple[str, str], Stamps] = {}

    def has_messages(self, topic: str) -> bool:
        """Whether there is any message of a topic, as far as the files say.

        Raises:
            InputError: the bag is damaged.
        """
        return any(storage.has_messages(topic) for storage in self._files.storages)

    def messages(self, topic: str, count: int = 1) -> list[Messages]:
        """The first messages of a topic: about ``count``, or a block more, or as many as there are.

        Raises:
            InputError: the bag is damaged.
        """
        found: list[Messages] = []
        if self.has_messages(topic):
            for block in blocks(self._files, (topic,), lambda _: None):
                found.append(block[topic])
                if sum(map(len, found)) >= count:
                    break
        return found

    def joints(self, topic: str) -> tuple[str, ...]:
        """Joints in the first messages of a topic, none if they are no joint states.

        Raises:
            InputError: the bag is damaged, or does not define the type.
        """
        if topic not in self._joints:
            kind = message_type(self._topics[topic], self._bag)
            reader = CdrReader(kind, [Selector("position", "")], stamp=False)
            if kind.name == JOINT_STATE:
                kind.require_joints("position")
                for messages in self.messages(topic):
                    reader.read(messages)
            self._joints[topic] = tuple(reader.joints)
        return self._joints[topic]

    def stamps(self, topic: str, clock: Literal["header", "log"]) -> Stamps:
        """Stamps of the first messages of a topic [ns].

        Raises:
            InputError: the bag is damaged, or messages have no stamps.
        """
        if (topic, clock) not in self._stamps:
            kind = message_type(self._topics[topic], self._bag)
            reader = CdrReader(kind, (), stamp=clock == "header")
            every = self.messages(topic, STAMPS)
            found = [reader.read(messages)[0] if clock == "header" else messages.log_ns for messages in every]
            self._stamps[topic, clock] = np.concatenate([np.empty(0, np.int64), *found])[:STAMPS]
        return self._stamps[topic, clock]


def blocks(
    files: BagFiles, topics: tuple[str, ...], advance: Callable[[int], object]
) -> Iterator[dict[str, Messages]]:
    """Messages of some topics in all files of a bag, unpacked (see ``Storage.blocks``).

    Raises:
        InputError: a file is damaged.
    """
    for storage in files.storages:
        for block in storage.blocks(topics, advance):
            if files.packed:
                yield {
                    topic: _unpacked(m, f"{storage.name}: topic {topic!r:.80}") for topic, m in block.items()
                }
            else:
                yield block


def _unpacked(messages: Messages, where: str) -> Messages:
    try:
        payloads = [unpack_message(messages[k], MESSAGE_BYTES) for k in range(len(messages))]
    except UnpackError as error:
        raise InputError(f"{where}: damaged, a compressed message {error}") from error
    return joined(payloads, messages.log_ns, where)
