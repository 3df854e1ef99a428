"""A constant in the torque's reading."""

import numpy as np

from discrepancy.serial.causes.base import Cause, at_joint


class TorqueOffset(Cause):
    """The torque reads too much by a constant."""

    title = "offset of the torque of {joint}"
    family = "constant_torque"
    parameters = ("offset_Nm",)
    scales = (0.3,)
    separate = "The torque's reading without power."

    def sentence(self, n):
        return f"the torque reads {n('offset_Nm', 'N m')} {n.either('offset_Nm', 'too much', 'too little')}"

    def columns(self, signals, at, shape):
        return at_joint(signals, at, np.ones(len(signals.time)))
