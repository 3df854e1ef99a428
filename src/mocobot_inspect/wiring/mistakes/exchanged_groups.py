"""Two groups of a robot exchanged: driven with gimbal angles, or angles with torques."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

from estimator.arm.design import OmnidDesign
from mocobot_inspect.signals import Group, Kind, Signals
from mocobot_inspect.wiring.mistakes.base import NAMES, Mistake, channel_names, teams


@dataclass(frozen=True)
class ExchangedGroups(Mistake):
    """One group in the columns of another.

    Attributes:
        pair: the two groups.
    """

    pair: tuple[Kind, Kind]

    kind: ClassVar[str] = "exchanged_groups"

    def undo(self, signals: Signals) -> Signals:
        """See ``Mistake.undo``."""
        a, b = (signals.group(kind) for kind in self.pair)
        return signals.having(self.pair[0], self._mixed(a, b)).having(self.pair[1], self._mixed(b, a))

    def _mixed(self, own: Group, other: Group) -> Group:
        values, noise = own.values.copy(), own.noise.copy()
        at = list(self.robots)
        values[:, :, at], noise[at] = other.values[:, :, at], other.noise[at]
        return Group(values, noise)

    @property
    def channels(self) -> tuple[str, ...]:
        """See ``Mistake.channels``."""
        return tuple(name for kind in self.pair for name in channel_names(self.level, kind))

    def what(self) -> str:
        """See ``Mistake.what``."""
        first, second = (NAMES[self.level][kind] for kind in self.pair)
        return f"the columns of {first} and {second} are exchanged"

    def subject(self) -> str:
        """See ``Mistake.subject``."""
        return " and ".join(NAMES[self.level][kind] for kind in self.pair) + " exchanged"


def suspects(signals: Signals, design: OmnidDesign) -> Iterator[ExchangedGroups]:
    """Every pair of groups, of all robots and of each."""
    pairs: tuple[tuple[Kind, Kind], ...] = (
        ("position", "theta"),
        ("position", "effort"),
        ("theta", "effort"),
    )
    for robots in teams(signals.robots):
        for pair in pairs:
            yield ExchangedGroups(signals.level, robots, signals.robots, pair)
