"""Rectangular pulses that someone adds to the loop's voltage."""

from discrepancy.emps.causes.base import Cause, filtered, voltage
from discrepancy.emps.pulse_search import rectangle


class InjectedVoltage(Cause):
    """Rectangular pulses between the loop's law and the drive: the drive gets, and the log has, law plus pulse."""

    name = "injected_voltage"
    family = "injection"
    where = "loop"
    parameters = ("size_V",)
    scales = (0.1,)
    separate = "The law's inputs and its output, logged separately."

    def columns(self, signals, shape):
        return voltage(filtered(signals, rectangle(signals.log.time, **shape)))

    def visible(self, signals, hints, values):
        # Of all rectangles that were tried, the best always fits something.
        return abs(values[0]) > hints.voltage_spread

    def shapes(self, hints):
        return [dict(hints.voltage_train)]

    def finer(self, shape):
        return [
            dict(shape) | {name: shape[name] + off}
            for name in ("start_s", "width_s")
            for off in (-1e-3, 1e-3)
        ]
