"""Friction that grows with the speed, the same in both directions."""

from discrepancy.emps.causes.base import Cause, force


class ViscousFriction(Cause):
    """A force against the motion in proportion to the speed."""

    title = "viscous friction"
    family = "viscous_friction"
    parameters = ("viscous_Ns_per_m",)
    scales = (10.0,)
    positive = ("viscous_Ns_per_m",)
    separate = "A steady motion at several speeds in one direction."

    def sentence(self, n):
        return f"rubs with {n('viscous_Ns_per_m', 'N s/m')} (viscous)"

    def columns(self, signals, shape):
        return force(signals.v)
