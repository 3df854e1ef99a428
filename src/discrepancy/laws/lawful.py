"""A rig whose candidates may be laws, on top of one that knows the causes of its catalogue."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable, Sequence

from discrepancy.candidate import Candidate
from discrepancy.laws.bench import Bench
from discrepancy.laws.candidate import LawCandidate, law_steps, refined
from discrepancy.laws.said.numbers import report
from discrepancy.least_squares.patches import Patches
from discrepancy.rig import Numbers, Rig
from estimator.arrays import Array


class Lawful(Rig):
    """To be put before a rig among the bases of a class: answers for laws, and asks that rig of anything else."""

    @property
    @abstractmethod
    def bench(self) -> Bench:
        """Places and signals."""

    def possible(self, candidate: Candidate, values: Array, covariance: Array) -> bool:
        return isinstance(candidate, LawCandidate) or super().possible(candidate, values, covariance)

    def unknowns(self, candidate: Candidate) -> Sequence[Patches]:
        if isinstance(candidate, LawCandidate):
            return [Patches(columns.shape[:2]) for columns in self.columns(candidate)]
        return super().unknowns(candidate)

    def imitators(self, candidate: Candidate) -> Iterable[list[Array]]:
        return [] if isinstance(candidate, LawCandidate) else super().imitators(candidate)

    def refinements(self, candidate: Candidate, *, finer: bool = False) -> list[Candidate]:
        if isinstance(candidate, LawCandidate):
            return refined(candidate, finer=finer)
        return super().refinements(candidate, finer=finer)

    def steps(self, candidate: Candidate) -> list[tuple[Candidate, Candidate, float]]:
        return law_steps(candidate) if isinstance(candidate, LawCandidate) else super().steps(candidate)

    def effect_parameters(
        self, candidate: Candidate, values: Array, covariance: Array
    ) -> tuple[Numbers, Numbers]:
        if isinstance(candidate, LawCandidate):
            return report(candidate, values, covariance)
        return super().effect_parameters(candidate, values, covariance)
