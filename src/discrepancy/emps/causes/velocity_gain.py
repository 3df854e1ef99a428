"""The velocity loop's gain is not its nominal value."""

from discrepancy import rules
from discrepancy.emps.causes.base import Cause, voltage


class VelocityGain(Cause):
    """The velocity loop is stronger than its nominal gain says."""

    title = "gain of the velocity loop"
    family = "velocity_gain"
    where = "loop"
    parameters = ("excess_Vs_per_m",)
    scales = (1.0,)
    separate = "The drive's voltage against the loop's own velocity error."

    def sentence(self, n):
        above = n.either("excess_Vs_per_m", "above", "below")
        return f"the velocity loop's gain is {n('excess_Vs_per_m', 'V s/m')} {above} its nominal value"

    def columns(self, signals, shape):
        return voltage(signals.log.kp_per_s * signals.error - signals.v)

    def visible(self, signals, hints, values):
        return abs(values[0]) > rules.GIVEN_TO_SHARE * signals.log.kv_Vs_per_m
