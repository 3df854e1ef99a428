"""A torque that repeats as the joint or its motor turns."""

import numpy as np

from discrepancy.serial.causes.base import Cause, at_joint


class Ripple(Cause):
    """A torque that resists or helps with the position: cogging of the motor, teeth of the gear, eccentricity."""

    title = "torque ripple in {joint}"
    family = "position_torque"
    parameters = ("cosine_Nm", "sine_Nm")
    scales = (0.3, 0.3)
    separate = "The same way at several speeds: what depends on the place stays there."

    def sentence(self, n):
        return (
            f"a torque repeats {n.values['turns']:.4g} times in a turn, with {n('cosine_Nm', 'N m', signed=True)} "
            f"(cosine) and {n('sine_Nm', 'N m', signed=True)} (sine)"
        )

    def columns(self, signals, at, shape):
        unit = 1.0 if signals.tree.slides[at] else 2.0 * np.pi
        # A slide's ``turns`` are waves per metre.
        angle = shape["turns"] * signals.q[:, at] * (2.0 * np.pi / unit)
        return at_joint(signals, at, np.cos(angle), np.sin(angle))

    def shapes(self, hints, at):
        return [{"turns": turns} for turns in hints.turns[at]]
