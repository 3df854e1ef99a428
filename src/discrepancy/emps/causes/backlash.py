"""Play between the motor, where the encoder is, and the carriage."""

import numpy as np

from discrepancy import rules
from discrepancy.emps.causes.base import Cause, force
from discrepancy.emps.recording.axis_log import FIRST_GUESS_KG
from estimator.filtering import differentiate, low_pass


class Backlash(Cause):
    """The carriage, half of the mass and all of the friction, follows the motor with a play of ``play_m`` in all."""

    title = "backlash"
    family = "backlash"
    parameters = ("play_m",)
    scales = (1e-5,)
    positive = ("play_m",)
    separate = "A scale or a dial gauge on the carriage while the motor reverses."

    def sentence(self, n):
        return f"motor and carriage have a play of {n('play_m', 'um', 1e6)} in all"

    def columns(self, signals, shape):
        # The side on which motor and carriage touch is that of the force passed on.
        passed = signals.force - (1.0 - rules.CARRIAGE_SHARE) * FIRST_GUESS_KG * signals.a
        rate = signals.log.rate_hz
        side = low_pass(np.tanh(passed / rules.PLAY_SOFT_N), rate, min(rules.PLAY_HZ, 0.2 * rate))
        second = differentiate(differentiate(side, rate), rate)
        return force(-0.5 * rules.CARRIAGE_SHARE * FIRST_GUESS_KG * second)

    def visible(self, signals, hints, values):
        # Rounding by whole steps has a hysteresis of its own.
        return abs(values[0]) > rules.PLAY_STEPS * signals.log.step_m
