"""Rectangular pulses that someone adds to the loop's voltage."""

from dataclasses import replace

from discrepancy.emps.causes.base import Cause, filtered, voltage
from discrepancy.emps.pulse_search import rectangle
from mocobot_sim.emps.plant import PulseTrain


class InjectedVoltage(Cause):
    """Rectangular pulses between the loop's law and the drive: the drive gets, and the log has, law plus pulse."""

    name = "injected_voltage"
    family = "injection"
    where = "loop"
    parameters = ("size_V",)
    scales = (0.1,)
    separate = "The law's inputs and its output, logged separately."

    def columns(self, signals, shape):
        train = PulseTrain(shape["start_s"], shape["period_s"], shape["width_s"], 1.0)
        return voltage(filtered(signals, rectangle(signals.log.time, train)))

    def apply(self, plant, values, shape):
        train = PulseTrain(shape["start_s"], shape["period_s"], shape["width_s"], float(values[0]))
        return replace(plant, voltage_pulses=(*plant.voltage_pulses, train))

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
