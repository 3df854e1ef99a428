"""Dry friction, the same in both directions."""

from discrepancy.emps.causes.base import Cause, filtered, force
from discrepancy.emps.causes.sliding import SLOW, direction, rests


class CoulombFriction(Cause):
    """A force against the motion that does not depend on the speed; below ``slow_mps`` it fades."""

    title = "Coulomb friction"
    family = "dry_friction"
    parameters = ("coulomb_N",)
    scales = (1.0,)
    positive = ("coulomb_N",)
    separate = "A steady motion at several speeds in one direction."

    def sentence(self, n):
        return f"rubs with {n('coulomb_N', 'N')} (Coulomb, while it moves)"

    def columns(self, signals, shape):
        return force(filtered(signals, direction(signals, shape["slow_mps"])))

    def shapes(self, hints):
        return SLOW

    def rests(self, signals, shape):
        return rests(signals, shape["slow_mps"])
