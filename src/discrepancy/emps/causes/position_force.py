"""A force that repeats along the way, as the screw or the motor turns."""

import numpy as np

from discrepancy import rules
from discrepancy.emps.causes.base import Cause, force


class PositionForce(Cause):
    """A force that resists or helps with the position, periodic over ``wavelength_m``."""

    title = "force that repeats along the way"
    family = "position_force"
    parameters = ("cosine_N", "sine_N")
    scales = (1.0, 1.0)
    separate = "The same way at several speeds: what depends on the place stays there."

    def sentence(self, n):
        return (
            f"a force repeats along the way every {n.values['wavelength_m'] * 1e3:.4f} mm, with "
            f"{n('cosine_N', 'N', signed=True)} (cosine) and {n('sine_N', 'N', signed=True)} (sine)"
        )

    def columns(self, signals, shape):
        angle = 2.0 * np.pi * signals.x / shape["wavelength_m"]
        return force(np.cos(angle), np.sin(angle))

    def shapes(self, hints):
        lengths = (factor * hints.wavelength_m for factor in (1.0, 0.5, 2.0))
        return [{"wavelength_m": length} for length in lengths if length >= rules.SHORTEST_RIPPLE_M]

    def finer(self, shape):
        return [
            {"wavelength_m": (1.0 + off) * shape["wavelength_m"]}
            for off in np.linspace(-2e-3, 2e-3, 9)
            if off
        ]
