"""Dry and viscous friction, the same in both directions: what every geared joint has."""

from discrepancy.rules import serial as rules
from discrepancy.serial.causes.base import Cause, at_joint, direction, slow_shapes


class Friction(Cause):
    """A torque against the motion: a constant, which fades below ``slow_per_s``, and one in proportion to the speed.

    They are one cause, since one alone would be looked for in vain where both are missing: of all single numbers some
    power of the speed fits best then.
    """

    title = "friction in {joint}"
    family = "friction"
    dry = True
    parameters = ("coulomb_Nm", "viscous_Nms_per_rad")
    scales = (1.0, 1.0)
    separate = "Steady motions at several speeds in either direction."

    def normal(self, tree, at):
        # A model that names but one of them has fitted neither.
        named = [float(tree.coulomb[at]), float(tree.viscous[at])]
        return [rules.JOINT_SHARE * x for x in named] if all(named) else [0.0, 0.0]

    def sentence(self, n):
        dry, more = n("coulomb_Nm", "N m"), n.either("coulomb_Nm", "more", "less")
        wet, faster = n("viscous_Nms_per_rad", "N m s/rad"), n.either("viscous_Nms_per_rad", "more", "less")
        return f"rubs with {dry} {more} than modelled while it moves (Coulomb), and {wet} {faster} (viscous)"

    def columns(self, signals, at, shape):
        return at_joint(signals, at, direction(signals, at, shape["slow_per_s"]), signals.dq[:, at])

    def shapes(self, hints, at):
        return slow_shapes(hints, at, rules.SLOW_SHARES)
