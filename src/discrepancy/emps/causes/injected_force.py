"""Rectangular pulses of force on the carriage, past the drive."""

from discrepancy.emps.causes.train import Pulses, train


class InjectedForce(Pulses):
    """Rectangular pulses of force on the carriage: the drive's voltage shows only what the loop does about them."""

    title = "injected pulses of force"
    parameters = ("resisting_N",)
    scales = (1.0,)
    adds_to = "force"

    def sentence(self, n):
        resists = n.either("resisting_N", "resists", "helps")
        return f"something {resists} forward motion with {n('resisting_N', 'N')}: {train(n)}"
