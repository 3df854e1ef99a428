"""Channels in another unit than they are taken for."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from estimator.arm.design import OmnidDesign
from mocobot_inspect.signals import Kind, Signals
from mocobot_inspect.wiring.mistakes.base import Mistake, teams

DEGREE = float(np.pi / 180)
ANGLES = (
    ("in degrees, not radians", DEGREE),
    ("converted from degrees, but was in radians", 1 / DEGREE),
)
LENGTHS = (
    ("in millimetres, not metres", 1e-3),
    ("converted from millimetres, but was in metres", 1e3),
)
TORQUES = (("in mN m, not N m", 1e-3), ("converted from mN m, but was in N m", 1e3))
FORCES = (("in mN, not N", 1e-3), ("converted from mN, but was in N", 1e3))
COUNTS_FROM_RAD = 50.0
"""Angles beyond this are tried as encoder counts."""
COUNT_BITS = tuple(range(8, 25))


@dataclass(frozen=True)
class WrongUnit(Mistake):
    """A group that has to be scaled.

    Attributes:
        words: the unit in words.
        factor: from the logged number to SI.
    """

    words: str
    factor: float

    def undo(self, signals: Signals) -> Signals:
        (group,) = self.groups
        return signals.having(group, signals.group(group).scaled(self.robots, self.factor))

    def what(self) -> str:
        return f"{self.named} is {self.words}"

    def subject(self) -> str:
        return f"unit of {self.named}"

    def to_dict(self) -> dict[str, Any]:
        return super().to_dict() | {"factor": self.factor}


def suspects(signals: Signals, design: OmnidDesign) -> Iterator[WrongUnit]:
    """Degrees, thousands and encoder counts, of all robots and of each."""
    joint = signals.level == "joint"
    units: dict[Kind, tuple[tuple[str, float], ...]] = {
        "theta": ANGLES,
        "position": ANGLES if joint else LENGTHS,
        "effort": TORQUES if joint else FORCES,
    }
    for robots in teams(signals.robots):
        for group, choices in units.items():
            for words, factor in (*choices, *_counts(signals, group)):
                yield WrongUnit("wrong_unit", signals.level, robots, signals.robots, (group,), words, factor)


def _counts(signals: Signals, group: Kind) -> Iterator[tuple[str, float]]:
    if group == "effort" or (group == "position" and signals.level == "wrist"):
        return
    if np.abs(signals.group(group).values[0]).max() > COUNTS_FROM_RAD:
        for bits in COUNT_BITS:
            yield f"in counts of 2^{bits} per turn, not radians", 2 * np.pi / 2**bits
