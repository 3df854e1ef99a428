"""The axis' causes in words."""

from discrepancy.causes.words import Words
from discrepancy.emps.causes import CAUSES


class EmpsWords(Words):
    """Sentences about the axis."""

    causes = CAUSES
    units = {  # noqa: RUF012
        "position": "m", "voltage": "V", "force": "N", "speed": "m/s", "velocity": "m/s", "acceleration": "m/s^2"
    }  # fmt: skip
