"""A team's rows with laws that no catalogue lists among the candidates."""

from __future__ import annotations

from functools import cached_property

from discrepancy.candidate import Candidate
from discrepancy.laws.candidate import LawCandidate, law_steps, refined
from discrepancy.team.laws.bench import TeamBench
from discrepancy.team.linear.signals import Signals
from discrepancy.team.rows import TeamRows
from estimator.arrays import Array


class LawfulRows(TeamRows):
    """Rows of a team whose candidates may be laws."""

    @property
    def bench(self) -> TeamBench:
        """Places and signals."""
        return self._bench

    @cached_property
    def _bench(self) -> TeamBench:
        return TeamBench(self.linear, self.whitening)

    def _unwhitened(self, trial: int, candidate: Candidate) -> Array:
        if isinstance(candidate, LawCandidate):
            return self.bench.columns(trial, candidate)
        return super()._unwhitened(trial, candidate)

    def _undo(self, trial: int, candidate: Candidate, values: Array, signals: Signals) -> Signals | None:
        if isinstance(candidate, LawCandidate):
            error = self.bench.reading_error(trial, candidate, values)
            return None if error is None else signals.minus(**error)
        return super()._undo(trial, candidate, values, signals)

    def possible(self, candidate: Candidate, values: Array, covariance: Array) -> bool:
        return isinstance(candidate, LawCandidate) or super().possible(candidate, values, covariance)

    def unknowns(self, candidate: Candidate) -> list[Array]:
        if isinstance(candidate, LawCandidate):
            return [columns[..., :0] for columns in self.columns(candidate)]
        return super().unknowns(candidate)

    def refinements(self, candidate: Candidate, *, finer: bool = False) -> list[Candidate]:
        if isinstance(candidate, LawCandidate):
            return refined(candidate, finer=finer)
        return super().refinements(candidate, finer=finer)

    def steps(self, candidate: Candidate) -> list[tuple[Candidate, Candidate, float]]:
        return law_steps(candidate) if isinstance(candidate, LawCandidate) else super().steps(candidate)
