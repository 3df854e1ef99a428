"""Rectangular pulses that someone adds to the loop's voltage."""

from discrepancy.emps.causes.train import Pulses, train


class InjectedVoltage(Pulses):
    """Rectangular pulses between the loop's law and the drive: the drive gets, and the log has, law plus pulse."""

    title = "injected pulses of voltage"
    where = "loop"
    parameters = ("size_V",)
    scales = (0.1,)
    adds_to = "voltage"

    def sentence(self, n):
        return f"something adds {n('size_V', 'V', signed=True)} between the law and the drive: {train(n)}"
