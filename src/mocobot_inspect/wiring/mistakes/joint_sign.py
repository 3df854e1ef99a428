"""Driven joints that turn the other way: their angles, or angles and torques."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from typing import ClassVar

from estimator.arm.design import OmnidDesign
from mocobot_inspect.signals import Kind, Signals
from mocobot_inspect.wiring.mistakes.base import SIGNS, Rearranged, teams

GROUPS: tuple[tuple[Kind, ...], ...] = (("position", "effort"), ("position",))


@dataclass(frozen=True)
class JointSign(Rearranged):
    """Signs of the phi triple, or of phi and tau."""

    kind: ClassVar[str] = "joint_sign"


def suspects(signals: Signals, design: OmnidDesign) -> Iterator[JointSign]:
    """All signs, of all robots and of each; at joint level only."""
    if signals.level != "joint":
        return
    for robots, kinds, signs in product(teams(signals.robots), GROUPS, SIGNS):
        if signs != (1, 1, 1):
            yield JointSign(signals.level, robots, signals.robots, kinds, (0, 1, 2), signs)
