"""A formula at a joint of a serial robot: what nobody has listed."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

from estimator.arrays import Array
from mocobot_sim.laws.formula import Formula, Signal

CREEP = 1e-3
"""Speed over which dry friction changes its direction here [rad/s or m/s]: slow beside what joints do."""


@dataclass(frozen=True, eq=False)
class State:
    """Of all joints at one step.

    Attributes:
        time_s: since the start.
        period_s: of a step.
        q, dq: positions and rates, shape (J,).
        ddq: accelerations of the step before, shape (J,).
        load: torques that the masses behind the joints ask for, shape (J,).
        torque: that the drives give, shape (J,).
    """

    time_s: float
    period_s: float
    q: Array
    dq: Array
    ddq: Array
    load: Array
    torque: Array

    def signal(self, name: str) -> float:
        """A signal by its name: ``time``, ``q_3``, ``direction_3`` and so on."""
        if name == "time":
            return self.time_s
        kind, _, number = name.rpartition("_")
        j = int(number) - 1
        return direction(float(self.dq[j])) if kind == "direction" else float(getattr(self, kind)[j])


def direction(speed: float) -> float:
    """Direction of a motion in [-1, 1]."""
    return math.tanh(speed / CREEP)


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
