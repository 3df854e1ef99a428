"""Gimbal angles in another order or with other signs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from typing import ClassVar

from estimator.arm.design import OmnidDesign
from mocobot_inspect.signals import Signals
from mocobot_inspect.wiring.mistakes.base import ORDERS, SIGNS, Rearranged, teams


@dataclass(frozen=True)
class GimbalAxes(Rearranged):
    """The theta triple rearranged."""

    kind: ClassVar[str] = "gimbal_axes"


def suspects(signals: Signals, design: OmnidDesign) -> Iterator[GimbalAxes]:
    """All orders and signs, of all robots and of each."""
    for robots in teams(signals.robots):
        for order, signs in product(ORDERS, SIGNS):
            if (order, signs) != ((0, 1, 2), (1, 1, 1)):
                yield GimbalAxes(signals.level, robots, signals.robots, ("theta",), order, signs)
