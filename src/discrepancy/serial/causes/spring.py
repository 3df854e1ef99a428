"""A spring at a joint."""

import numpy as np

from discrepancy.serial.causes.base import Cause, at_joint


class Spring(Cause):
    """A spring that the model does not have, such as a cable, pulls towards some position."""

    title = "spring at {joint}"
    family = "position_torque"
    parameters = ("stiffness_Nm_per_rad", "preload_Nm")
    scales = (1.0, 0.3)
    separate = "Slow motions over the whole range."

    def sentence(self, n):
        stiffness = n("stiffness_Nm_per_rad", "N m/rad", signed=True)
        return f"a spring of {stiffness} pulls back, with {n('preload_Nm', 'N m', signed=True)} at zero"

    def columns(self, signals, at, shape):
        return at_joint(signals, at, signals.q[:, at], np.ones(len(signals.time)))
