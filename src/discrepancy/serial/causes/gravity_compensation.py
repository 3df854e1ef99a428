"""The torque has been freed of gravity before it was logged, or the model's gravity was compensated elsewhere."""

import numpy as np

from discrepancy.serial.causes.base import Cause
from discrepancy.serial.mechanics.shift import by_acceleration


class GravityCompensation(Cause):
    """A share of gravity's torque is missing in what is logged."""

    title = "missing gravity compensation"
    family = "gravity"
    part = "arm"
    parameters = ("share",)
    scales = (0.1,)
    separate = "The torque of the arm at rest in several poses."

    def sentence(self, n):
        return f"{n('share', '%', 100.0, signed=True)} of gravity's torque is missing in the log"

    def columns(self, signals, at, shape):
        gravity = -np.einsum("wji,i->wj", by_acceleration(signals.motion), signals.tree.gravity)
        return -gravity[..., None]
