"""A weight or a spring balances a joint."""

import numpy as np

from discrepancy.serial.causes.base import Cause, at_joint


class Counterbalance(Cause):
    """A torque that goes with sine and cosine of the joint's angle, as that of a balancing spring or weight."""

    title = "counterbalance of {joint}"
    family = "position_torque"
    parameters = ("cosine_Nm", "sine_Nm")
    scales = (1.0, 1.0)
    separate = "Slow motions over the whole range."

    def sentence(self, n):
        cosine, sine = n("cosine_Nm", "N m", signed=True), n("sine_Nm", "N m", signed=True)
        return f"a torque goes with its angle, {cosine} (cosine) and {sine} (sine), as that of a balancer"

    def shapes(self, hints, at):
        return [{}] if hints.turns[at] else []

    def columns(self, signals, at, shape):
        return at_joint(signals, at, np.cos(signals.q[:, at]), np.sin(signals.q[:, at]))
