"""A formula at a joint of a serial robot: what nobody has listed."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import ClassVar

from mocobot_sim.laws.formula import Formula, Signal
from mocobot_sim.serial.state import State


class JointLaw(Formula):
    """A formula at a joint, counted from 1.

    Its ``target`` is ``torque_3``, what the torque of joint 3 holds besides, or ``position_3``, what its reading is off
    by, which is an error of the log and not simulated. Signals are ``time``, ``q_3``, ``dq_3``, ``ddq_3``,
    ``direction_3``, ``load_3`` and ``torque_3``.
    """

    targets: ClassVar = (re.compile(r"(torque|position)_[1-9][0-9]*"), "torque_3, position_3")
    signals: ClassVar = (
        re.compile(r"time|(q|dq|ddq|direction|load|torque)_[1-9][0-9]*"),
        "time, q_3, dq_3, ddq_3, direction_3, load_3, torque_3",
    )

    @property
    def joint(self) -> int:
        """At which joint, from 1."""
        return int(self.target.rpartition("_")[2])

    @property
    def acts(self) -> bool:
        """Whether it is a torque, and no error of a reading."""
        return self.target.startswith("torque")


class ActingLaw:
    """A law in one run: it may remember what was, such as a play.

    Attributes:
        law: which.
    """

    def __init__(self, law: JointLaw) -> None:
        self.law = law
        self._value: Callable[[Signal], float] | None = None

    def torque(self, state: State) -> float:
        """What it takes from the drive of its joint now [N m or N]; to be asked once a step."""
        self._value = self._value or self.law.running(state.period_s)
        return self._value(state.signal)
