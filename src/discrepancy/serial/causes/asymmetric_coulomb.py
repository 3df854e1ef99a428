"""Dry friction that differs between the directions."""

import numpy as np

from discrepancy.rules import serial as rules
from discrepancy.serial.causes.base import Cause, at_joint, direction, slow_shapes


class AsymmetricCoulomb(Cause):
    """Dry friction is larger forwards and smaller backwards, by ``asymmetry_Nm`` each; while it slides, a constant."""

    title = "Coulomb friction in {joint} that differs by direction"
    family = "constant_torque"
    dry = True
    parameters = ("asymmetry_Nm",)
    scales = (0.3,)
    separate = "Rest: raise the torque slowly in either direction and see where the joint breaks loose."

    def sentence(self, n):
        forwards = n.either("asymmetry_Nm", "larger", "smaller")
        backwards = n.either("asymmetry_Nm", "smaller", "larger")
        return f"dry friction is {n('asymmetry_Nm', 'N m')} {forwards} forwards and as much {backwards} backwards"

    def columns(self, signals, at, shape):
        return at_joint(signals, at, np.abs(direction(signals, at, shape["slow_per_s"])))

    def shapes(self, hints, at):
        return slow_shapes(hints, at, (rules.SLOW_SHARES[0], rules.SLOW_SHARES[-1]))
