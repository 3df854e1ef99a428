"""Viscous friction that differs between the directions."""

import numpy as np

from discrepancy.emps.causes.base import Cause, filtered, force

LARGER_SMALLER = ("larger", "smaller"), ("smaller", "larger")


class AsymmetricViscous(Cause):
    """Viscous friction is larger forwards and smaller backwards, by ``asymmetry_Ns_per_m`` each."""

    name = "asymmetric_viscous"
    family = "asymmetric_viscous"
    parameters = ("asymmetry_Ns_per_m",)
    scales = (10.0,)
    separate = (
        "Steady motions at several speeds in both directions: a constant force does not grow with the speed."
    )

    def sentence(self, n):
        size = n("asymmetry_Ns_per_m", "N s/m")
        forwards, backwards = (n.either("asymmetry_Ns_per_m", *words) for words in LARGER_SMALLER)
        return f"viscous friction is {size} {forwards} forwards and as much {backwards} backwards"

    def columns(self, signals, shape):
        return force(filtered(signals, np.abs(signals.v)))
