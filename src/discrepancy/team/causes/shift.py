"""Readings of other instants than they say."""

import numpy as np
from scipy.interpolate import CubicSpline

from discrepancy.team.causes.base import ReadingError, one_robot


class Late(ReadingError):
    """A robot's readings are those of ``delay_s`` ago.

    Attributes:
        readings: which of them.
    """

    parameters = ("delay_s",)
    at = "robot"
    readings = ("tau",)

    def errors(self, signals, robot, joint, shape, design):
        rates = {x: signals.with_rates(getattr(signals, x)[:, robot])[1] for x in self.readings}
        return [{x: -rate for x, rate in rates.items()}]

    def undo(self, signals, trial, robot, joint, values, shape):
        time = np.arange(len(signals.time)) / signals.rate_hz
        at = np.clip(time + values[0], 0.0, time[-1])  # held at the ends
        late = {}
        for name in self.readings:
            x = getattr(signals, name)[:, robot]
            shifted = CubicSpline(time, x)(at)
            # The last piece meets the last sample but for rounding, and what is held is the sample.
            shifted[at >= time[-1]] = x[-1]
            late[name] = one_robot(x - shifted, trial.robots, robot)
        return signals.minus(**late)
