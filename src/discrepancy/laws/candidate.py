"""A law as a candidate of the diagnosis: a place and a formula."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from discrepancy import rules
from discrepancy.candidate import Candidate, Parameter
from discrepancy.laws.dictionary import nearby
from discrepancy.laws.place import Place
from discrepancy.laws.term import Term

CAUSE, FAMILY = "law", "unlisted"


@dataclass(frozen=True, eq=False, kw_only=True)
class LawCandidate(Candidate):
    """Something that nobody has listed: an error at a place that is a function of a signal.

    Attributes:
        at: the place.
        term: the function; its numbers are the candidate's shape.
    """

    at: Place
    term: Term

    @property
    def key(self) -> tuple[str, int | None, int | None]:
        """Place and signal: another function of the same signal is another form of the same thing."""
        return f"{CAUSE}: {self.at.name} by {' '.join(self.term.variables)}", self.robot, self.joint

    @property
    def place(self) -> str:
        """The place in words."""
        return f"{super().place}{self.at.called}"

    def _at(self, part: str) -> str:
        return f"{super()._at(part)}{self.at.called}"

    @property
    def where_it_is(self) -> str:
        """What is wrong, at its place, in words."""
        return super().label

    @property
    def label(self) -> str:
        """The same, and of what it is a function."""
        signals = [v.words for v in (self.term.of, self.term.times) if v is not None]
        by = "a constant" if self.term.function == "constant" else f"by {' and '.join(signals)}"
        return f"{self.where_it_is}, {by}"

    def in_shape(self, shape: Mapping[str, float]) -> LawCandidate:
        """The same with other numbers inside the function, within what they may be."""
        numbers = self.term.law.within(shape)
        return replace(self, term=replace(self.term, numbers=numbers), shape=dict(numbers))


def candidate_of(place: Place, term: Term, scale: float, among: int) -> LawCandidate:
    """A law at a place.

    Args:
        place: where.
        term: which function of what.
        scale: a typical size of the error [the place's unit].
        among: how many laws it was chosen from.
    """
    count = rules.LAW_KNOTS if term.function == "spline" else 2 if term.function in ("sine", "hum") else 1
    parts = ["amplitude"] if count == 1 else [f"amplitude_{k + 1}" for k in range(count)]
    if term.of.parts:
        parts = [f"amplitude_by_{part.name}" for part in term.of.each]
    if place.offset and term.function not in ("constant", "spline"):
        parts.append("offset")
    names = [f"{part}_{axis}".strip("_").replace(" ", "_") for part in parts for axis in place.axes]
    parameters = tuple(Parameter(name, 0.0, scale) for name in names)
    return LawCandidate(
        CAUSE, FAMILY, place.robot, place.joint, parameters, dict(term.numbers), where=place.where,
        title=place.title, among=among, at=place, term=term,
    )  # fmt: skip


def refined(candidate: LawCandidate, *, finer: bool) -> list[Candidate]:
    """The law with other numbers inside its function; ``finer`` ones around its own."""
    return [candidate.in_shape(dict(term.numbers)) for term in nearby(candidate.term, finer=finer)]


def law_steps(candidate: LawCandidate) -> list[tuple[Candidate, Candidate, float]]:
    """The law with each number that the data determine changed both ways, and by how much."""
    numbers, out = dict(candidate.term.numbers), []
    for name, share in candidate.term.law.fitted.items():
        value = numbers[name]
        less, more = (candidate.in_shape({**numbers, name: x * value}) for x in (1.0 - share, 1.0 + share))
        out.append((less, more, more.shape[name] - less.shape[name]))
    return out
