"""The moving mass is not the first guess."""

from discrepancy.causes.numbers import number
from discrepancy.emps.causes.base import Cause, force
from discrepancy.emps.recording.axis_log import FIRST_GUESS_KG


class Mass(Cause):
    """The axis moves another mass than assumed."""

    title = "moving mass"
    family = "inertia"
    parameters = ("excess_kg",)
    scales = (1.0,)
    separate = "A known weight on the carriage: it adds its own mass, whatever the drive's gain is."

    def sentence(self, n):
        total = number(FIRST_GUESS_KG + n.values["excess_kg"], n.se.get("excess_kg"), "kg")
        more = n.either("excess_kg", "more", "less")
        return f"the axis moves {total}, {n('excess_kg', 'kg')} {more} than first guessed"

    def columns(self, signals, shape):
        return force(signals.a)
