"""A motor that is given a voltage gives less torque the faster it turns."""

import numpy as np

from discrepancy.serial.causes.base import Cause, at_joint


class BackEmf(Cause):
    """While its drive is on, a motor that is given a voltage loses torque in proportion to its speed.

    Where a drive is never off, or tells torques or currents, this is viscous friction, and said as such.
    """

    title = "back-EMF in {joint}"
    family = "friction"
    parameters = ("braking_Nms_per_rad",)
    scales = (0.1,)
    positive = ("braking_Nms_per_rad",)
    separate = "The same motion with the drive off, such as a fall."

    def sentence(self, n):
        return f"loses {n('braking_Nms_per_rad', 'N m s/rad')} of torque to its speed while its drive is on (back-EMF)"

    def shapes(self, hints, at):
        return [{}] if hints.switched[at] else []

    def columns(self, signals, at, shape):
        on = np.ones(len(signals.time)) if signals.enabled is None else signals.enabled
        return at_joint(signals, at, on * signals.dq[:, at])
