"""Rotors, as the joint feels them, have another inertia than the model says."""

from discrepancy.rules import serial as rules
from discrepancy.serial.causes.base import Cause, at_joint


class Armature(Cause):
    """The rotor's inertia through the gear differs from the model's ``armature``."""

    title = "rotor inertia of {joint}"
    family = "inertia"
    parameters = ("armature_kgm2",)
    scales = (0.1,)
    separate = "Fast short motions of this joint alone, in a pose where gravity does not load it."

    def normal(self, tree, at):
        return [rules.JOINT_SHARE * float(tree.armature[at])]

    def sizes(self, tree, at):
        return [max(self.normal(tree, at)[0], *self.scales)]

    def sentence(self, n):
        more = n.either("armature_kgm2", "more", "less")
        return f"the rotor adds {n('armature_kgm2', 'kg m^2')} {more} than modelled"

    def possible(self, tree, at, values, se):
        return bool(tree.armature[at] + values[0] > -2.0 * se[0])

    def columns(self, signals, at, shape):
        return at_joint(signals, at, signals.ddq[:, at])
