"""Dry friction that differs between the directions."""

import numpy as np

from discrepancy.emps.causes.base import Cause, filtered, force
from discrepancy.emps.causes.sliding import SLOW, direction

LARGER_SMALLER = ("larger", "smaller"), ("smaller", "larger")


class AsymmetricCoulomb(Cause):
    """Dry friction is larger forwards and smaller backwards, by ``asymmetry_N`` each; while it slides, a constant."""

    name = "asymmetric_coulomb"
    family = "constant_force"
    parameters = ("asymmetry_N",)
    scales = (1.0,)
    separate = (
        "Rest: raise the voltage slowly from zero in each direction and see where the axis breaks loose; a constant "
        "force shifts both, friction that differs does not push."
    )

    def sentence(self, n):
        forwards, backwards = (n.either("asymmetry_N", *words) for words in LARGER_SMALLER)
        return (
            f"dry friction is {n('asymmetry_N', 'N')} {forwards} forwards and as much {backwards} backwards"
        )

    def columns(self, signals, shape):
        return force(filtered(signals, np.abs(direction(signals, shape["slow_mps"]))))

    def shapes(self, hints):
        return SLOW
