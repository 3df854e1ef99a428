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
        return f"{self.part} {self.joint}{told_name(self.joint, self.called)}"

    @property
    def label(self) -> str:
        """The cause at its place, in words: ``Coulomb friction in joint 3 (elbow)``."""
        return re.sub(r"\{.*?\}", self.place, self.title) if self.joint else self.kind

    @property
    def kind(self) -> str:
        """The cause in words, wherever it sits: ``Coulomb friction in a joint``."""
        return re.sub(r"\{(.*?)\}", lambda part: _some(part[1]), self.title) or self.cause.replace("_", " ")


def told_name(joint: int, called: str) -> str:
    """A joint's name behind its number, as `` (elbow)``; nothing where it says no more, as "joint_3" of joint 3."""
    told = re.fullmatch(rf"(joint|j|axis|link)?[ _-]?0*{joint}", called, re.IGNORECASE)
    return "" if told or not called else f" ({called})"


def _some(part: str) -> str:
    return "two joints" if part == "pair" else f"a {part}"


def place_of(candidate: Candidate) -> int:
    """Which joint a candidate is at, from 0; -1 of the whole arm."""
    return -1 if candidate.joint is None else candidate.joint - 1
