"""Rectangular pulses of force on the carriage, past the drive."""

from discrepancy.emps.causes.base import Cause, filtered, force
from discrepancy.emps.causes.train import sharper, train
from discrepancy.emps.pulse_search import rectangle


class InjectedForce(Cause):
    """Rectangular pulses of force on the carriage: the drive's voltage shows only what the loop does about them."""

    name = "injected_force"
    family = "injection"
    parameters = ("resisting_N",)
    scales = (1.0,)
    separate = "The law's inputs and its output, logged separately."

    def sentence(self, n):
        resists = n.either("resisting_N", "resists", "helps")
        return f"something {resists} forward motion with {n('resisting_N', 'N')}: {train(n)}"

    def columns(self, signals, shape):
        return force(filtered(signals, rectangle(signals.log.time, **shape)))

    def visible(self, signals, hints, values):
        # Of all rectangles that were tried, the best always fits something.
        return abs(values[0]) > hints.force_spread

    def shapes(self, hints):
        return [dict(hints.force_train)]

    def finer(self, shape):
        return sharper(shape)
