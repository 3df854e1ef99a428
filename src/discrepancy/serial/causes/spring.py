"""A spring at a joint."""

from discrepancy.serial.causes.base import Cause, at_joint


class Spring(Cause):
    """A spring that the model does not have, such as a cable, pulls back towards ``neutral``."""

    title = "spring at {joint}"
    family = "position_torque"
    parameters = ("stiffness_Nm_per_rad",)
    scales = (1.0,)
    separate = "Slow motions over the whole range."

    def sentence(self, n):
        stiffness = n("stiffness_Nm_per_rad", "N m/rad", signed=True)
        return f"a spring of {stiffness} pulls back to {n('neutral', 'rad', signed=True)}"

    def columns(self, signals, at, shape):
        return at_joint(signals, at, signals.q[:, at] - shape["neutral"])

    def shapes(self, hints, at):
        # Where it is neutral is one with the torque's offset; the middle of the travel is no worse than any.
        return [{"neutral": float(hints.middle[at])}]
