"""One group of channels of two robots exchanged.

Exchanging *all* groups of two robots only renumbers them, which no data tell; so an exchanged phi is the same as
exchanged theta and tau.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations
from typing import Any

from estimator.arm.design import OmnidDesign
from mocobot_inspect.signals import KINDS, Signals
from mocobot_inspect.wiring.mistakes.base import NAMES, Mistake, listed

MOST_AT_ONCE = 3


@dataclass(frozen=True)
class SwappedRobots(Mistake):
    """One group of several robots in the wrong order.

    Attributes:
        order: true robot i is logged as robot ``order[i]``.
    """

    order: tuple[int, ...]

    def undo(self, signals: Signals) -> Signals:
        (group,) = self.groups
        return signals.having(group, signals.group(group).renumbered(self.order))

    def what(self) -> str:
        if len(self.robots) == 2:
            others = " and ".join(NAMES[self.level][kind] for kind in KINDS if kind not in self.groups)
            return f"their {self.named} columns are exchanged (or those of {others}: the same but for their numbers)"
        parts = [f"robot {self.order[i] + 1} has those of robot {i + 1}" for i in self.robots]
        return f"their {self.named} columns are mixed up: {listed(parts)}"

    def subject(self) -> str:
        return f"{self.named} of robots exchanged"

    def who(self) -> str:
        return f"robots {listed([str(robot + 1) for robot in self.robots])}"

    def to_dict(self) -> dict[str, Any]:
        return super().to_dict() | {"order": [robot + 1 for robot in self.order]}


def suspects(signals: Signals, design: OmnidDesign) -> Iterator[SwappedRobots]:
    """Every pair, and every cycle of three in small teams (in large ones, one pair after the other)."""
    N = signals.robots
    orders = []
    for i, j in combinations(range(N), 2):
        order = list(range(N))
        order[i], order[j] = j, i
        orders.append(((i, j), tuple(order)))
    for three in combinations(range(N), 3) if N <= MOST_AT_ONCE + 1 else ():
        for a, b, c in (three, (three[0], three[2], three[1])):
            order = list(range(N))
            order[a], order[b], order[c] = b, c, a
            orders.append((three, tuple(order)))
    for robots, order in orders:
        for group in KINDS:
            yield SwappedRobots("swapped_robots", signals.level, robots, N, (group,), order)
