"""A suspected mistake in the wiring of a log, and how to undo it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from mocobot_inspect.signals import Kind, Signals
from mocobot_logs.log import CHANNELS, Level

NAMES: dict[Level, dict[Kind, str]] = {
    "joint": {"position": "phi", "theta": "theta", "effort": "tau"},
    "wrist": {"position": "h", "theta": "theta", "effort": "force"},
}


@dataclass(frozen=True)
class Mistake(ABC):
    """One thing that may be wrong with some robots' channels.

    Attributes:
        kind: name of the mistake in reports.
        level: level of the log.
        robots: robots concerned, from 0.
        team: number of robots N.
        groups: groups of channels concerned.
    """

    kind: str
    level: Level
    robots: tuple[int, ...]
    team: int
    groups: tuple[Kind, ...]

    @abstractmethod
    def undo(self, signals: Signals) -> Signals:
        """The signals as they would be without the mistake."""

    @abstractmethod
    def what(self) -> str:
        """The mistake in words, without the robots where they are ``robots``."""

    @abstractmethod
    def subject(self) -> str:
        """What the mistake is about, the same for its opposite."""

    @property
    def channels(self) -> tuple[str, ...]:
        """Channels concerned, as in ``CHANNELS[level]``."""
        return tuple(name for kind in self.groups for name in channel_names(self.level, kind))

    @property
    def named(self) -> str:
        """The groups in words."""
        return " and ".join(NAMES[self.level][kind] for kind in self.groups)

    def sentence(self) -> str:
        """The mistake in words."""
        return f"{self.who()}: {self.what()}"

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
