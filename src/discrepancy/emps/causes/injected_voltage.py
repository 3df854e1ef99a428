"""Rectangular pulses that someone adds to the loop's voltage."""

from discrepancy.emps.causes.base import Cause, filtered, voltage
from discrepancy.emps.causes.train import sharper, train
from discrepancy.emps.pulse_search import rectangle


class InjectedVoltage(Cause):
    """Rectangular pulses between the loop's law and the drive: the drive gets, and the log has, law plus pulse."""

    name = "injected_voltage"
    family = "injection"
    where = "loop"
    parameters = ("size_V",)
    scales = (0.1,)
    separate = "The law's inputs and its output, logged separately."

    def sentence(self, n):
        return f"something adds {n('size_V', 'V', signed=True)} between the law and the drive: {train(n)}"

    def columns(self, signals, shape):
        return voltage(filtered(signals, rectangle(signals.log.time, **shape)))

    def visible(self, signals, hints, values):
        # Of all rectangles that were tried, the best always fits something.
        return abs(values[0]) > hints.voltage_spread

    def shapes(self, hints):
        return [dict(hints.voltage_train)]

    def finer(self, shape):
        return sharper(shape)
