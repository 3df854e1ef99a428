"""Torques, or forces at wrist level, with the wrong sign."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from typing import ClassVar

from estimator.arm.design import OmnidDesign
from mocobot_inspect.signals import Signals
from mocobot_inspect.wiring.mistakes.base import SIGNS, Rearranged, teams


@dataclass(frozen=True)
class TorqueSign(Rearranged):
    """Signs of the tau triple, or of the force triple."""

    kind: ClassVar[str] = "torque_sign"


def suspects(signals: Signals, design: OmnidDesign) -> Iterator[TorqueSign]:
    """All signs, of all robots and of each."""
    for robots, signs in product(teams(signals.robots), SIGNS):
        if signs != (1, 1, 1):
            yield TorqueSign(signals.level, robots, signals.robots, ("effort",), (0, 1, 2), signs)
