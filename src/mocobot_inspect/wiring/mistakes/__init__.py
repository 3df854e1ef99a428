"""Mistakes in the wiring of a log that are looked for, one suspicion per file."""

from __future__ import annotations

from collections.abc import Iterator

from estimator.arm.design import OmnidDesign
from mocobot_inspect.signals import Signals
from mocobot_inspect.wiring.mistakes import (
    exchanged_groups,
    gimbal_axes,
    joint_order,
    joint_sign,
    swapped_robots,
    torque_sign,
    wrist_axes,
    wrong_unit,
    wrong_zero,
)
from mocobot_inspect.wiring.mistakes.base import Mistake

SUSPICIONS = (
    wrong_unit,
    torque_sign,
    gimbal_axes,
    swapped_robots,
    joint_order,
    joint_sign,
    wrist_axes,
    exchanged_groups,
    wrong_zero,
)
"""In the order in which they are believed where the data cannot tell them apart."""


def suspects(signals: Signals, design: OmnidDesign) -> Iterator[Mistake]:
    """Every mistake that is looked for in a log."""
    for suspicion in SUSPICIONS:
        yield from suspicion.suspects(signals, design)
