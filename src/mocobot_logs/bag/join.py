"""How the topics of one robot become its rows."""

from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np

from estimator.errors import InputError
from mocobot_logs.bag.align import Part, RowAligner
from mocobot_logs.bag.look import Look
from mocobot_logs.bag.messages import printable
from mocobot_logs.log import Samples, Stamps

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
