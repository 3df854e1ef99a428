"""A cause at a joint, at a link, or of the whole arm."""

import re
from dataclasses import dataclass

from discrepancy.candidate import Candidate


@dataclass(frozen=True)
class SerialCandidate(Candidate):
    """A candidate that knows what its joint is called.

    Attributes:
        part: ``joint``, ``link`` (the one that the joint moves), ``pair`` (the joint and the one before it) or ``arm``.
        called: the joint's name in the model.
        slide: whether the joint slides.
        partner: of a pair, the other joint, counted from 1.
    """

    part: str = "arm"
    called: str = ""
    slide: bool = False
    partner: int | None = None

    @property
    def place(self) -> str:
        """The place in words: ``joint 3 (elbow)``."""
        if self.joint is None:
            return self.where
        if self.part == "pair":
            return f"joints {self.partner} and {self.joint}"
        return f"{self.part} {self.joint}{self._name}"

    @property
    def label(self) -> str:
        """The cause at its place, in words: ``Coulomb friction in joint 3 (elbow)``."""
        return re.sub(r"\{.*?\}", self.place, self.title) if self.joint else self.kind

    @property
    def kind(self) -> str:
        """The cause in words, wherever it sits: ``Coulomb friction in a joint``."""
        return re.sub(r"\{(.*?)\}", lambda part: _some(part[1]), self.title) or self.cause.replace("_", " ")

    @property
    def _name(self) -> str:
        # "joint 3 (joint_3)" says nothing.
        told = re.fullmatch(rf"(joint|j|axis|link)?[ _-]?0*{self.joint}", self.called, re.IGNORECASE)
        return "" if told or not self.called else f" ({self.called})"


def _some(part: str) -> str:
    return "two joints" if part == "pair" else f"a {part}"
