"""Dry friction that differs between the directions."""

import numpy as np

from discrepancy.causes.numbers import Numbers
from discrepancy.emps.causes.base import Cause, filtered, force
from discrepancy.emps.causes.sliding import SLOW, direction


def each_way(n: Numbers, name: str, unit: str) -> str:
    """How much larger or smaller friction is in either direction."""
    forwards, backwards = n.either(name, "larger", "smaller"), n.either(name, "smaller", "larger")
    return f"{n(name, unit)} {forwards} forwards and as much {backwards} backwards"


class AsymmetricCoulomb(Cause):
    """Dry friction is larger forwards and smaller backwards, by ``asymmetry_N`` each; while it slides, a constant."""

    title = "Coulomb friction that differs by direction"
    family = "constant_force"
    parameters = ("asymmetry_N",)
    scales = (1.0,)
    separate = (
        "Rest: raise the voltage slowly from zero in each direction and see where the axis breaks loose; a constant "
        "force shifts both, friction that differs does not push."
    )

    def sentence(self, n):
        return f"dry friction is {each_way(n, 'asymmetry_N', 'N')}"

    def columns(self, signals, shape):
        return force(filtered(signals, np.abs(direction(signals, shape["slow_mps"]))))

    def shapes(self, hints):
        return SLOW
