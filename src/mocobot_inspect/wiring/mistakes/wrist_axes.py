"""Wrist positions and forces in other axes: their order and signs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from typing import ClassVar

from estimator.arm.design import OmnidDesign
from mocobot_inspect.signals import Kind, Signals
from mocobot_inspect.wiring.mistakes.base import ORDERS, SIGNS, Rearranged, teams

GROUPS: tuple[tuple[Kind, ...], ...] = (("position", "effort"), ("position",), ("effort",))


@dataclass(frozen=True)
class WristAxes(Rearranged):
    """The h triple, the force triple or both rearranged."""

    kind: ClassVar[str] = "wrist_axes"


def suspects(signals: Signals, design: OmnidDesign) -> Iterator[WristAxes]:
    """All orders and signs, of all robots and of each; at wrist level only."""
    if signals.level != "wrist":
        return
    every = product(ORDERS, SIGNS)
    for robots, kinds, (order, signs) in product(teams(signals.robots), GROUPS, every):
        same_axes = order == (0, 1, 2)
        # Signs of forces alone are a suspicion of their own.
        if not (same_axes and (signs == (1, 1, 1) or kinds == ("effort",))):
            yield WristAxes(signals.level, robots, signals.robots, kinds, order, signs)
