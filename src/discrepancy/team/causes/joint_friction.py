"""Coulomb and viscous friction of a driven joint, between spring and link."""

from discrepancy.team.causes.sliding import Friction


class JointFriction(Friction):
    """The link gets less than the spring gives while it moves; below ``slow_rad_per_s`` it rests."""

    title = "friction in {driven joint}"
    separate = "An arm-only run (payload released) shows friction of the joint alone."
