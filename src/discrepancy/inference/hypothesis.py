"""A hypothesis: some causes at some places are there; how likely it is, and the fit that goes with it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

from discrepancy.candidate import Candidate
from discrepancy.inference.learn import Learnt, learnt
from discrepancy.inference.prior import log_prior_odds
from discrepancy.least_squares.fit import Fit
from discrepancy.least_squares.problem import Problem
from discrepancy.rig import Rig


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """What is there, at its best.

    Attributes:
        learnt: its spreads and powers, and its evidence.
        allowed: what a healthy one of a cause would explain, too, by the cause: not to its credit [nats].
    """

    learnt: Learnt
    allowed: Mapping[int, float] = field(default_factory=dict)

    @classmethod
    def of(
        cls, problem: Problem, free: Sequence[int], allowed: Mapping[int, float] | None = None
    ) -> Hypothesis:
        """The hypothesis that some of a problem's candidates are there."""
        return cls(learnt(problem, free), allowed or {})

    @property
    def problem(self) -> Problem:
        """With its spreads and powers."""
        return self.learnt.problem

    @property
    def free(self) -> tuple[int, ...]:
        """Which of the problem's candidates are there."""
        return self.learnt.free

    @property
    def causes(self) -> list[Candidate]:
        """What is there."""
        return [self.problem.candidates[i] for i in self.free]

    @cached_property
    def fit(self) -> Fit:
        """The values with it."""
        return Fit.of(self.problem, self.free)

    @cached_property
    def score(self) -> float:
        """Log posterior probability, up to what all hypotheses have in common [nats]."""
        return self.uncharged - sum(self.allowed[i] for i in self.free if i in self.allowed)

    @property
    def uncharged(self) -> float:
        """The same without what is not to the causes' credit: which of two is there the data alone tell [nats]."""
        odds = sum(log_prior_odds(self.problem, candidate) for candidate in self.causes)
        return self.learnt.log_evidence + odds

    def without(self, index: int) -> Hypothesis:
        """The hypothesis that one of the causes is not there."""
        keys = set(self.problem.opened) - {self.problem.candidates[index].key}
        return Hypothesis.of(
            self.problem.without_unknowns(keys), self._others(index), self._allowed_but(index)
        )

    def tolerating(self, index: int) -> Hypothesis | None:
        """The hypothesis that one of the causes is there by its law, but no farther off than its kind scatters.

        None of a cause that a healthy one has none of, or an event.
        """
        if not self.problem.has_tolerance(index):
            return None
        return Hypothesis.of(self.problem, self._others(index), self._allowed_but(index))

    def _allowed_but(self, index: int) -> dict[int, float]:
        return {i: nats for i, nats in self.allowed.items() if i != index}

    def _others(self, index: int) -> list[int]:
        return [i for i in self.free if i != index]

    def possible(self, rig: Rig, index: int) -> bool:
        """Whether one of the causes has values that can be."""
        candidate = self.problem.candidates[index]
        values, covariance = self.fit.part(index)
        units = candidate.units
        return rig.possible(candidate, values * units, covariance * units[:, None] * units)
