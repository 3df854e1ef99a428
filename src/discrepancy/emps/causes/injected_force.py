"""Rectangular pulses of force on the carriage, past the drive."""

from discrepancy.emps.causes.train import Pulses, in_step, train


class InjectedForce(Pulses):
    """Rectangular pulses of force on the carriage: the drive's voltage shows only what the loop does about them."""

    title = "injected pulses of force"
    parameters = ("resisting_N",)
    scales = (1.0,)
    adds_to = "force"

    def sentence(self, n):
        resists = n.either("resisting_N", "resists", "helps")
        return f"something {resists} forward motion with {n('resisting_N', 'N')}: {train(n)}"

    def imitators(self, signals, hints, shape):
        # Friction where the axis turns comes in pulses, too, as often as the motion does.
        return [] if hints.cycle_s is None else in_step(signals.log.time, hints.cycle_s, shape)
