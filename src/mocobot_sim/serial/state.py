"""What a serial robot does at a step, by the names that laws give its signals."""

from __future__ import annotations

import math
from dataclasses import dataclass

from estimator.arrays import Array

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
