"""The torque's reading is late."""

import numpy as np
from scipy.interpolate import CubicSpline

from discrepancy.rules import serial as rules
from discrepancy.serial.causes.base import Cause, at_joint
from estimator.filtering import differentiate


class TorqueDelay(Cause):
    """The torque is read later than the position, or was filtered before."""

    title = "delay of the torque of {joint}"
    family = "delay"
    parameters = ("delay_s",)
    tolerances = (rules.DELAY_S,)
    separate = "A step of the torque with the joint clamped."

    def sentence(self, n):
        return f"the torque comes {n('delay_s', 'ms', 1e3)} {n.either('delay_s', 'late', 'early')}"

    def columns(self, signals, at, shape):
        return at_joint(signals, at, -differentiate(signals.torque[:, at], signals.rate_hz))

    def exact(self, signals, at, values, shape):
        torque, time = signals.torque[:, at], signals.time
        then = np.clip(time + values[0], time[0], time[-1])
        return at_joint(signals, at, torque - CubicSpline(time, torque)(then))[..., 0]
