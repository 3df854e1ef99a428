"""Two groups of a robot exchanged: driven with gimbal angles, or angles with torques."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

from estimator.arm.design import OmnidDesign
from mocobot_inspect.signals import KINDS, Group, Signals
from mocobot_inspect.wiring.mistakes.base import Mistake, teams


@dataclass(frozen=True)
class ExchangedGroups(Mistake):
    """Each of two groups in the columns of the other."""

    def undo(self, signals: Signals) -> Signals:
        first, second = self.groups
        a, b = signals.group(first), signals.group(second)
        return signals.having(first, self._mixed(a, b)).having(second, self._mixed(b, a))

    def _mixed(self, own: Group, other: Group) -> Group:
        values, noise = own.values.copy(), own.noise.copy()
        at = list(self.robots)
        values[:, :, at], noise[at] = other.values[:, :, at], other.noise[at]
        return Group(values, noise)

    def what(self) -> str:
        return f"the columns of {self.named} are exchanged"

    def subject(self) -> str:
        return f"{self.named} exchanged"


def suspects(signals: Signals, design: OmnidDesign) -> Iterator[ExchangedGroups]:
    """Every pair of groups, of all robots and of each."""
    for robots in teams(signals.robots):
        for pair in combinations(KINDS, 2):
            yield ExchangedGroups("exchanged_groups", signals.level, robots, signals.robots, pair)
