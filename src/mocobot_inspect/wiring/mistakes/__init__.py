"""Mistakes in the wiring of a log that are looked for."""

from collections.abc import Iterator

from estimator.arm.design import OmnidDesign
from mocobot_inspect.signals import Signals
from mocobot_inspect.wiring.mistakes import exchanged_groups, swapped_robots, wrong_unit, wrong_zero
from mocobot_inspect.wiring.mistakes.base import Mistake
from mocobot_inspect.wiring.mistakes.rearranged import REARRANGED

SUSPICIONS = (
    wrong_unit,
    REARRANGED["torque_sign"],
    REARRANGED["gimbal_axes"],
    swapped_robots,
    REARRANGED["joint_order"],
    REARRANGED["joint_sign"],
    REARRANGED["wrist_axes"],
    exchanged_groups,
    wrong_zero,
)
"""In the order in which they are believed where the data cannot tell them apart."""


def suspects(signals: Signals, design: OmnidDesign) -> Iterator[Mistake]:
    """Every mistake that is looked for in a log."""
    for suspicion in SUSPICIONS:
        yield from suspicion.suspects(signals, design)
