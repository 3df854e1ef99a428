"""A suspected mistake in the wiring of a log, and how to undo it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from mocobot_inspect.signals import Kind, Signals
from mocobot_logs.log import CHANNELS, Level

Three = tuple[int, int, int]
ORDERS: tuple[Three, ...] = ((0, 1, 2), (0, 2, 1), (1, 0, 2), (2, 1, 0), (1, 2, 0), (2, 0, 1))
SIGNS: tuple[Three, ...] = (
    (1, 1, 1), (-1, -1, -1), (-1, 1, 1), (1, -1, 1), (1, 1, -1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1),
)  # fmt: skip
NAMES: dict[Level, dict[Kind, str]] = {
    "joint": {"position": "phi", "theta": "theta", "effort": "tau"},
    "wrist": {"position": "h", "theta": "theta", "effort": "force"},
}


@dataclass(frozen=True)
class Mistake(ABC):
    """One thing that may be wrong with some robots' channels.

    Attributes:
        level: level of the log.
        robots: robots concerned, from 0.
        team: number of robots N.
    """

    level: Level
    robots: tuple[int, ...]
    team: int

    kind: ClassVar[str]
    """Name of the mistake in reports."""

    @abstractmethod
    def undo(self, signals: Signals) -> Signals:
        """The signals as they would be without the mistake."""

    @abstractmethod
    def what(self) -> str:
        """The mistake in words, without the robots where they are ``robots``."""

    @property
    def channels(self) -> tuple[str, ...]:
        """Channels concerned, as in ``CHANNELS[level]``."""
        return ()

    def sentence(self) -> str:
        """The mistake in words."""
        return f"{self.who()}: {self.what()}"

    @abstractmethod
    def subject(self) -> str:
        """What the mistake is about, the same for its opposite."""

    def who(self) -> str:
        """The robots in words."""
        if len(self.robots) == self.team and self.team > 1:
            return "all robots"
        return f"robot{'s' * (len(self.robots) > 1)} {listed([str(robot + 1) for robot in self.robots])}"

    def refined(self, total: Callable[[Mistake], float]) -> Mistake:
        """The same with its size fitted, where it has one.

        Args:
            total: the misfit that is left with a mistake undone.
        """
        return self

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return {
            "kind": self.kind,
            "robots": [robot + 1 for robot in self.robots],
            "channels": list(self.channels),
            "sentence": self.sentence(),
        }


@dataclass(frozen=True)
class Rearranged(Mistake):
    """Three channels of a robot in another order or with other signs.

    Attributes:
        kinds: groups concerned, all in the same way.
        order, signs: the true channel k is ``signs[k]`` times the logged channel ``order[k]``.
    """

    kinds: tuple[Kind, ...]
    order: Three
    signs: Three

    def undo(self, signals: Signals) -> Signals:
        """See ``Mistake.undo``."""
        for kind in self.kinds:
            signals = signals.having(kind, signals.group(kind).arranged(self.robots, self.order, self.signs))
        return signals

    @property
    def channels(self) -> tuple[str, ...]:
        """See ``Mistake.channels``."""
        return tuple(
            names[self.order[k]]
            for names in (channel_names(self.level, kind) for kind in self.kinds)
            for k in range(3)
            if (self.order[k], self.signs[k]) != (k, 1)
        )

    def what(self) -> str:
        """See ``Mistake.what``."""
        return " and ".join(self._of(channel_names(self.level, kind), kind) for kind in self.kinds)

    def subject(self) -> str:
        """See ``Mistake.subject``."""
        groups = " and ".join(NAMES[self.level][kind] for kind in self.kinds)
        signs, order = min(self.signs) < 0, self.order != (0, 1, 2)
        return ("order and signs" if signs and order else "signs" if signs else "order") + f" of {groups}"

    def _of(self, names: Sequence[str], kind: Kind) -> str:
        if self.order == (0, 1, 2):
            turned = [names[k] for k in range(3) if self.signs[k] < 0]
            every = NAMES[self.level][kind]
            if len(turned) == 3:
                return f"{every} has the wrong sign"
            return f"{listed(turned)} {'has' if len(turned) == 1 else 'have'} the wrong sign"
        moved = [k for k in range(3) if self.order[k] != k]
        if len(moved) == 2 and all(sign > 0 for sign in self.signs):
            return f"{names[moved[0]]} and {names[moved[1]]} are exchanged"
        parts = [
            f"column {names[self.order[k]]} holds {'-' if self.signs[k] < 0 else ''}{names[k]}"
            for k in range(3)
            if (self.order[k], self.signs[k]) != (k, 1)
        ]
        return listed(parts)


def channel_names(level: Level, kind: Kind) -> tuple[str, ...]:
    """Names of a group's three channels."""
    first = {"position": 0, "theta": 3, "effort": 6}[kind]
    return CHANNELS[level][first : first + 3]


def teams(robots: int) -> Iterator[tuple[int, ...]]:
    """All robots together, then each alone."""
    if robots > 1:
        yield tuple(range(robots))
    for robot in range(robots):
        yield (robot,)


def listed(words: Sequence[str]) -> str:
    """Words with commas and an "and"."""
    if len(words) < 2:
        return "".join(words)
    return ", ".join(words[:-1]) + " and " + words[-1]
