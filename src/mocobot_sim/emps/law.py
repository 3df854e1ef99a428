"""A formula at the axis: what nobody has listed."""

from __future__ import annotations

import re
from typing import ClassVar

from mocobot_sim.laws.formula import Formula


class AxisLaw(Formula):
    """A formula at the axis.

    Its ``target`` is ``force``, against forward motion [N], or ``voltage``, added to the loop's law [V]. Signals are
    ``time`` (of the log's clock), ``position``, ``velocity``, ``acceleration``, ``direction`` of the carriage, and
    ``error``, reference minus position.
    """

    targets: ClassVar = (re.compile("force|voltage"), "force, voltage")
    signals: ClassVar = (
        re.compile("time|position|velocity|acceleration|direction|error"),
        "time, position, velocity, acceleration, direction, error",
    )
