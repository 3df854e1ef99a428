"""A team's rows with laws that no catalogue lists among the candidates."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Self

from discrepancy.candidate import Candidate
from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.laws.candidate import LawCandidate
from discrepancy.laws.lawful import Lawful
from discrepancy.team.laws.bench import TeamBench
from discrepancy.team.laws.places import is_reading
from discrepancy.team.linear.signals import Signals
from discrepancy.team.rows import TeamRows
from estimator.arrays import Array


class LawfulRows(Lawful, TeamRows):
    """Rows of a team whose candidates may be laws."""

    @property
    def bench(self) -> TeamBench:
        """Places and signals."""
        return self._bench

    @cached_property
    def _bench(self) -> TeamBench:
        return TeamBench(self.linear, self.whitening)

    def relinearised(self, found: Hypothesis) -> Self | None:
        """As of a rig without laws; beside laws it stays, as these are of signals as they are where they were found."""
        if any(isinstance(candidate, LawCandidate) for candidate in found.causes):
            return None
        return super().relinearised(found)

    def _unwhitened(self, trial: int, candidate: Candidate) -> Array:
        if isinstance(candidate, LawCandidate):
            return self.bench.columns(trial, candidate)
        return super()._unwhitened(trial, candidate)

    def _is_adjusted(self, candidate: Candidate) -> bool:
        if isinstance(candidate, LawCandidate):
            return is_reading(candidate.at)
        return super()._is_adjusted(candidate)

    def bent(self, candidate: Candidate, values: Array) -> tuple[Sequence[Array], Sequence[Array]] | None:
        if not isinstance(candidate, LawCandidate):
            return super().bent(candidate, values)
        slopes, whole = [], []
        for t, whitening in enumerate(self.whitening):
            bent = self.bench.bent(t, candidate, values)
            if bent is None:
                return None
            slopes.append(whitening(bent[0]))
            whole.append(whitening(bent[1]))
        return slopes, whole

    def _undo(self, trial: int, candidate: Candidate, values: Array, signals: Signals) -> Signals | None:
        if isinstance(candidate, LawCandidate):
            error = self.bench.reading_error(trial, candidate, values, signals)
            return None if error is None else signals.minus(**error)
        return super()._undo(trial, candidate, values, signals)
