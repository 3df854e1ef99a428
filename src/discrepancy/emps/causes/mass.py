"""The moving mass is not the first guess."""

from dataclasses import replace

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

    def apply(self, plant, values, shape):
        return replace(plant, mass_kg=max(plant.mass_kg + values[0], 1.0))
