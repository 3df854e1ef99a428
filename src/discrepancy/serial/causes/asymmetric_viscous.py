"""Viscous friction that differs between the directions."""

import numpy as np

from discrepancy.serial.causes.base import Cause, at_joint


class AsymmetricViscous(Cause):
    """Friction grows faster with the speed forwards and slower backwards, by ``asymmetry_Nms_per_rad`` each."""

    title = "viscous friction in {joint} that differs by direction"
    family = "asymmetric_friction"
    parameters = ("asymmetry_Nms_per_rad",)
    scales = (0.3,)
    separate = "Steady motions at several speeds in either direction."

    def sentence(self, n):
        name = "asymmetry_Nms_per_rad"
        forwards, backwards = n.either(name, "larger", "smaller"), n.either(name, "smaller", "larger")
        return f"viscous friction is {n(name, 'N m s/rad')} {forwards} forwards and as much {backwards} backwards"

    def columns(self, signals, at, shape):
        return at_joint(signals, at, np.abs(signals.dq[:, at]))
