"""The loop's velocity is old: it is a difference of past positions, or filtered."""

from discrepancy.emps.causes.base import Cause, voltage
from discrepancy.emps.recording.signals import at_delay


class VelocityLag(Cause):
    """The loop uses a velocity that is ``lag_s`` old."""

    title = "age of the velocity in the loop"
    family = "velocity_lag"
    where = "loop"
    parameters = ("lag_s",)
    scales = (1e-4,)
    separate = "The loop's own velocity signal in the log."

    def sentence(self, n):
        return (
            f"the velocity that the loop uses is {n('lag_s', 'ms', 1e3)} {n.either('lag_s', 'old', 'ahead')}"
        )

    def columns(self, signals, shape):
        return voltage(signals.log.kv_Vs_per_m * signals.a)

    def exact(self, signals, values, shape):
        log = signals.log
        change = signals.v - at_delay(signals.v, log.rate_hz, values[0])
        return voltage(log.kv_Vs_per_m * change)[..., 0]
