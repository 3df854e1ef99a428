"""The torque's reading is off in scale."""

from discrepancy.rules import serial as rules
from discrepancy.serial.causes.base import Cause, at_joint


class TorqueScale(Cause):
    """The torque reads ``1 + scale`` times what it is, such as by a torque constant that is off."""

    title = "scale of the torque of {joint}"
    family = "torque_scale"
    parameters = ("scale",)
    tolerances = (rules.SCALE_SHARE,)
    separate = "A known weight on the arm."

    def sentence(self, n):
        return f"the torque reads {n('scale', '%', 100.0)} {n.either('scale', 'too much', 'too little')}"

    def possible(self, tree, at, values, se):
        return abs(values[0]) < self.most(tree, at)[0]

    def most(self, tree, at):
        return [rules.MOST_SCALE]

    def columns(self, signals, at, shape):
        # The model's torque, not the measured one: that would explain itself. What it lacks of friction counts as read.
        return at_joint(signals, at, signals.asked[:, at])
