"""The drive acts late."""

from discrepancy.emps.causes.base import Cause, force
from discrepancy.emps.recording.signals import at_delay
from estimator.filtering import differentiate


class Delay(Cause):
    """The force follows the voltage late, beyond the half period that its hold takes anyway."""

    title = "delay of the drive"
    family = "delay"
    where = "drive"
    parameters = ("delay_s",)
    scales = (1e-4,)
    separate = "A step of the voltage with the loop open."

    def sentence(self, n):
        later = n.either("delay_s", "later", "earlier")
        return f"the force follows the voltage {n('delay_s', 'ms', 1e3)} {later} than its hold alone would"

    def columns(self, signals, shape):
        return force(differentiate(signals.force, signals.log.rate_hz))

    def exact(self, signals, values, shape):
        late = at_delay(signals.force, signals.log.rate_hz, values[0])
        return force(signals.force - late)[..., 0]
