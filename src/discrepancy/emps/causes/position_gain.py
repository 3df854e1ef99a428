"""The position loop's gain is not its nominal value."""

from discrepancy import rules
from discrepancy.emps.causes.base import Cause, voltage


class PositionGain(Cause):
    """The position loop is stronger than its nominal gain says."""

    title = "gain of the position loop"
    family = "position_gain"
    where = "loop"
    parameters = ("excess_per_s",)
    scales = (1.0,)
    separate = "A motion at constant speed, where the tracking error is the speed over this gain."

    def sentence(self, n):
        above = n.either("excess_per_s", "above", "below")
        return f"the position loop's gain is {n('excess_per_s', '1/s')} {above} its nominal value"

    def columns(self, signals, shape):
        return voltage(signals.log.kv_Vs_per_m * signals.error)

    def visible(self, signals, hints, values):
        return abs(values[0]) > rules.GIVEN_TO_SHARE * signals.log.kp_per_s
