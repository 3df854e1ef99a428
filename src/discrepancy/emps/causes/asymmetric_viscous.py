"""Viscous friction that differs between the directions."""

import numpy as np

from discrepancy.emps.causes.asymmetric_coulomb import each_way
from discrepancy.emps.causes.base import Cause, filtered, force


class AsymmetricViscous(Cause):
    """Viscous friction is larger forwards and smaller backwards, by ``asymmetry_Ns_per_m`` each."""

    title = "viscous friction that differs by direction"
    family = "asymmetric_viscous"
    parameters = ("asymmetry_Ns_per_m",)
    scales = (10.0,)
    separate = (
        "Steady motions at several speeds in both directions: a constant force does not grow with the speed."
    )

    def sentence(self, n):
        return f"viscous friction is {each_way(n, 'asymmetry_Ns_per_m', 'N s/m')}"

    def columns(self, signals, shape):
        return force(filtered(signals, np.abs(signals.v)))
