"""Play between motor and link."""

import numpy as np

from discrepancy.rules import serial as rules
from discrepancy.serial.causes.base import Cause
from discrepancy.serial.causes.elasticity import along
from estimator.filtering import low_pass


class Backlash(Cause):
    """The link lags behind the encoder by half the play, to the side that its load pushes."""

    title = "backlash in {joint}"
    family = "elasticity"
    laden = True
    parameters = ("play_rad",)
    scales = (1e-3,)
    positive = ("play_rad",)
    separate = "The link moved by hand with the motor held."

    def sentence(self, n):
        return f"has {n('play_rad', 'mrad', 1e3)} of play between motor and link"

    def columns(self, signals, at, shape):
        cutoff = signals.cutoff_hz
        load = low_pass(signals.inverse[:, at], signals.rate_hz, cutoff)
        soft = rules.SOFT_LOAD_SHARE * max(float(np.sqrt(np.mean(load**2))), 1e-12)
        side = low_pass(np.tanh(load / soft), signals.rate_hz, cutoff)
        return along(signals, at, -0.5 * side)[..., None]
