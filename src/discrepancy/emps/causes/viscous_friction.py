"""Friction that grows with the speed, the same in both directions."""

from dataclasses import replace

from discrepancy.emps.causes.base import Cause, force


class ViscousFriction(Cause):
    """A force against the motion in proportion to the speed."""

    name = "viscous_friction"
    family = "viscous_friction"
    parameters = ("viscous_Ns_per_m",)
    scales = (10.0,)
    positive = ("viscous_Ns_per_m",)
    separate = "A steady motion at several speeds in one direction."

    def columns(self, signals, shape):
        return force(signals.v)

    def apply(self, plant, values, shape):
        forward, backward = plant.viscous_Ns_per_m
        return replace(plant, viscous_Ns_per_m=(forward + values[0], backward + values[0]))
