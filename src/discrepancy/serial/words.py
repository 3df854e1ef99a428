"""A serial robot's causes in words."""

from collections.abc import Mapping
from dataclasses import dataclass

from discrepancy.candidate import Candidate
from discrepancy.causes.numbers import Numbers
from discrepancy.causes.words import Words
from discrepancy.laws.candidate import LawCandidate
from discrepancy.serial.candidate import SerialCandidate
from discrepancy.serial.causes import CAUSES
from discrepancy.serial.causes.base import parameter_name
from discrepancy.serial.model import SerialModel

SHOWN = {
    "N m s/rad": "N s/m",
    "N m/rad": "N/m",
    "mrad per N m": "mm per N",
    "N m": "N",
    "mrad": "mm",
    "rad/s": "m/s",
    "kg m^2": "kg",
}
"""Units as sentences show them, of a joint that turns and of one that slides."""


@dataclass(frozen=True)
class SlideNumbers(Numbers):
    """Numbers of a joint that slides, for sentences about one that turns."""

    def __call__(self, name: str, unit: str, scale: float = 1.0, *, signed: bool = False) -> str:
        return super().__call__(parameter_name(name, slide=True), SHOWN.get(unit, unit), scale, signed=signed)

    def either(self, name: str, more: str, less: str) -> str:
        return super().either(parameter_name(name, slide=True), more, less)


class SerialWords(Words):
    """Sentences about the robot.

    Args:
        model: whose joints slide, or turn.
        reference: whether numbers count from logs of the robot while it was well, not from the model.
    """

    causes = CAUSES
    units = {"speed": "typical speeds"}  # noqa: RUF012

    def __init__(self, model: SerialModel, *, reference: bool = False) -> None:
        self._than = "than in the reference" if reference else "than modelled"
        joints = enumerate(zip(model.joints, model.slides, strict=True), start=1)
        sliding = [(j, name) for j, (name, slides) in joints if slides]
        self._slides = {f"{name} torque": "N" for _, name in sliding}
        self._slides |= {f"position of joint {j}": "m" for j, _ in sliding}

    def describe(self, candidate: Candidate, values: Mapping[str, float], se: Mapping[str, float]) -> str:
        """What a cause does at its place, one sentence with its numbers; standard errors may be NaN."""
        if isinstance(candidate, LawCandidate):
            return super().describe(candidate, values, se)
        slide = isinstance(candidate, SerialCandidate) and candidate.slide
        numbers = SlideNumbers(values, se) if slide else Numbers(values, se)
        cause = CAUSES[candidate.cause]
        return f"{cause.place(candidate)}: {cause.sentence(numbers)}.".replace("than modelled", self._than)

    def unit(self, name: str) -> str:
        """Unit of a channel, or of a quantity that a misfit may depend on."""
        turns = "rad" if name.startswith("position of joint") else "N m"
        return self._slides.get(name) or self.units.get(name, turns)
