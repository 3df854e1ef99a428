"""What a bag's storage hands over: its topics, and serialised messages by the block."""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from estimator.errors import InputError
from mocobot_logs.faults import shown
from mocobot_logs.log import Stamps

BLOCK_BYTES = 4 << 20
"""About so many bytes of messages are handed over at a time, unless a chunk of the file is larger."""
MESSAGE_BYTES = 16 << 20
"""Largest message that is read [bytes]; one robot's joint states take some hundred."""
SHOWN = 20
"""So many topics or joints are listed in a message."""


@dataclass(frozen=True)
class Topic:
    """A topic of a bag.

    Attributes:
        name: such as ``/omnid1/joint/joint_states``.
        type: such as ``sensor_msgs/msg/JointState``.
        encoding: how messages are serialised, ``cdr`` in all that is read.
        definition_format: ``ros2msg``, ``ros2idl``, or "" where the bag has no definition of the type.
        definition: text of the definition.
        count: number of messages as far as it is known, else None.
    """

    name: str
    type: str
    encoding: str
    definition_format: str = ""
    definition: str = ""
    count: int | None = None


@dataclass(frozen=True, eq=False)
class Messages:
    """Serialised messages of one topic inside a block of memory, in the order of the bag.

    Attributes:
        block: the memory.
        start: first byte of each message, shape (q,).
        size: its number of bytes, shape (q,).
        log_ns: when the recorder wrote it [ns], shape (q,).
    """

    block: bytes
    start: NDArray[np.int64]
    size: NDArray[np.int64]
    log_ns: Stamps

    def __len__(self) -> int:
        """Number of messages q."""
        return len(self.start)

    def __getitem__(self, index: int) -> bytes:
        """One message."""
        start = int(self.start[index])
        return self.block[start : start + int(self.size[index])]


class Storage(Protocol):
    """One file of a bag.

    Attributes:
        name: what messages call it.
        size: bytes to read.
        topics: by name.
    """

    name: str
    size: int
    topics: dict[str, Topic]

    def blocks(
        self, topics: Collection[str], advance: Callable[[int], object], block_bytes: int = BLOCK_BYTES
    ) -> Iterator[dict[str, Messages]]:
        """Messages of some topics in the order of the file; topics without messages in a block are left out.

        Args:
            topics: names of the topics.
            advance: takes the bytes read since the last call.
            block_bytes: about so many bytes at a time, where the file leaves the choice.

        Raises:
            InputError: the file is damaged.
        """
        ...

    def has_messages(self, topic: str) -> bool:
        """Whether there is any message of a topic, as far as the file says.

        Raises:
            InputError: the file is damaged.
        """
        ...


def joined(payloads: Sequence[bytes], log_ns: Stamps, where: str) -> Messages:
    """Messages that come one by one, in one block of memory.

    Raises:
        InputError: one is larger than ``MESSAGE_BYTES``.
    """
    size = np.fromiter(map(len, payloads), np.int64, len(payloads))
    check_sizes(size, where)
    return Messages(b"".join(payloads), np.cumsum(size) - size, size, log_ns)


def check_sizes(size: NDArray[np.int64], where: str) -> None:
    """Refuse messages that are larger than ``MESSAGE_BYTES``.

    Raises:
        InputError: one is.
    """
    if len(size) and (largest := int(size.max())) > MESSAGE_BYTES:
        raise InputError(
            f"{where}: a message of {largest / 2**20:.1f} MiB; joint data are read from messages of at most "
            f"{MESSAGE_BYTES >> 20} MiB"
        )


def merged(topics: Iterable[Topic], where: str) -> dict[str, Topic]:
    """Topics by name: recorders list one once for each quality of service, and once in each file.

    Raises:
        InputError: a topic has one type or encoding here and another one there.
    """
    found: dict[str, Topic] = {}
    for topic in topics:
        known = found.setdefault(topic.name, topic)
        if known is topic:
            continue
        for one, other in ((known.type, topic.type), (known.encoding, topic.encoding)):
            if one != other:
                raise InputError(
                    f"{where}: topic {topic.name!r:.80} holds both {one!r:.80} and {other!r:.80}"
                )
        count = None if known.count is None or topic.count is None else known.count + topic.count
        found[topic.name] = replace(known if known.definition_format else topic, count=count)
    return found


def listed(topics: Mapping[str, Topic]) -> str:
    """The topics of a bag and their types, for messages."""
    if not topics:
        return "the bag has no topics"
    first = list(topics.values())[:SHOWN]
    names = ", ".join(f"{printable(topic.name)} ({printable(topic.type)})" for topic in first)
    more = f", ... ({len(topics)} in all)" if len(topics) > SHOWN else ""
    return f"the bag's topics are {names}{more}"


def listed_names(names: Sequence[str]) -> str:
    """Names of a file, for messages."""
    return ", ".join(map(printable, names[:SHOWN])) + (", ..." if len(names) > SHOWN else "") or "none"


def printable(text: str) -> str:
    """Text of a file as a terminal may show it."""
    return shown(text, 80)
