"""A joint's zero is not where the model has it."""

from dataclasses import replace

import numpy as np

from discrepancy.rules import serial as rules
from discrepancy.serial.causes.base import Cause
from discrepancy.serial.mechanics.regressor import torque_of


class JointZero(Cause):
    """The joint is farther than it reads, by ``zero_rad``; it shows where gravity does other work."""

    title = "zero of {joint}"
    family = "zero"
    laden = True
    moves = True
    parameters = ("zero_rad",)
    separate = "A mark, or an inclinometer on the link."

    def sentence(self, n):
        return (
            f"stands {n('zero_rad', 'mrad', 1e3)} {n.either('zero_rad', 'farther', 'less far')} than it reads"
        )

    def normal(self, tree, at):
        return [rules.ZERO_M if tree.slides[at] else rules.ZERO_RAD]

    def sizes(self, tree, at):
        return self.normal(tree, at)

    def possible(self, tree, at, values, se):
        return abs(values[0]) < self.most(tree, at)[0]

    def most(self, tree, at):
        return [rules.MOST_LENGTH_M if tree.slides[at] else rules.MOST_ZERO_RAD]

    def applied(self, signals, at, values, shape):
        return replace(signals, q=signals.q + values[0] * (np.arange(signals.q.shape[1]) == at))

    def columns(self, signals, at, shape):
        step = rules.STEP_M if signals.tree.slides[at] else rules.STEP_RAD
        both = self._torque(signals, at, step) - self._torque(signals, at, -step)
        return both[..., None] / (2.0 * step)

    def exact(self, signals, at, values, shape):
        return self._torque(signals, at, values[0]) - self._torque(signals, at, 0.0)

    def _torque(self, signals, at, by):
        q = signals.q + by * (np.arange(signals.q.shape[1]) == at)
        return torque_of(signals.tree, q, signals.dq, signals.ddq)
