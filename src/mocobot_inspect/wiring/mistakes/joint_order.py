"""Driven joints in another order: their angles, their torques, or both."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from typing import ClassVar

from estimator.arm.design import OmnidDesign
from mocobot_inspect.signals import Kind, Signals
from mocobot_inspect.wiring.mistakes.base import ORDERS, Rearranged, teams

GROUPS: tuple[tuple[Kind, ...], ...] = (("position", "effort"), ("position",), ("effort",))


@dataclass(frozen=True)
class JointOrder(Rearranged):
    """The phi triple, the tau triple or both rearranged."""

    kind: ClassVar[str] = "joint_order"


def suspects(signals: Signals, design: OmnidDesign) -> Iterator[JointOrder]:
    """All orders, of all robots and of each; at joint level only."""
    if signals.level != "joint":
        return
    for robots, kinds, order in product(teams(signals.robots), GROUPS, ORDERS):
        if order != (0, 1, 2):
            yield JointOrder(signals.level, robots, signals.robots, kinds, order, (1, 1, 1))
