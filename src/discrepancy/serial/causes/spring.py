"""A spring at a joint."""

from discrepancy.rules import serial as rules
from discrepancy.serial.causes.base import Cause, at_joint


class Spring(Cause):
    """A spring that the model does not have, such as a cable, pulls back towards ``neutral``."""

    title = "spring at {joint}"
    family = "position_torque"
    parameters = ("stiffness_Nm_per_rad",)
    scales = (1.0,)
    alike = len(rules.NEUTRAL_SHARES)
    separate = "Slow motions over the whole range."

    def sentence(self, n):
        stiffness = n("stiffness_Nm_per_rad", "N m/rad", signed=True)
        return f"a spring of {stiffness} pulls back to {n('neutral', 'rad', signed=True)}"

    def columns(self, signals, at, shape):
        return at_joint(signals, at, signals.q[:, at] - shape["neutral"])

    def shapes(self, hints, at):
        # Masses take up what a joint's gravity does, and of a spring there is left what its neutral makes of it.
        middle, travel = float(hints.middle[at]), float(hints.travel[at])
        return [{"neutral": middle + share * travel, "travel": travel} for share in rules.NEUTRAL_SHARES]

    def steps(self, shape):
        return {"neutral": rules.NEUTRAL_STEP_SHARE * shape["travel"]}
