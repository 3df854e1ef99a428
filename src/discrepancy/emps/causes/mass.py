"""The moving mass is not the first guess."""

from discrepancy.emps.causes.base import Cause, force


class Mass(Cause):
    """The axis moves another mass than assumed."""

    name = "mass"
    family = "inertia"
    parameters = ("excess_kg",)
    scales = (1.0,)
    separate = "A known weight on the carriage: it adds its own mass, whatever the drive's gain is."

    def columns(self, signals, shape):
        return force(signals.a)
