"""A hypothesis: some causes at some places are there; how likely it is, and the fit that goes with it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from discrepancy.engine.learn import Learnt, learnt
from discrepancy.engine.prior import log_prior_odds
from discrepancy.engine.scan import log_evidence_of
from discrepancy.least_squares.fit import Fit
from discrepancy.least_squares.problem import Problem
from discrepancy.rig import Candidate, Rig


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """What is there, at its best.

    Attributes:
        learnt: its spreads and powers, and its evidence.
    """

    learnt: Learnt

    @classmethod
    def of(cls, problem: Problem, free: Sequence[int]) -> Hypothesis:
        """The hypothesis that some of a problem's candidates are there."""
        return cls(learnt(problem, free))

    @property
    def problem(self) -> Problem:
        """With its spreads and powers."""
        return self.learnt.problem

    @property
    def free(self) -> tuple[int, ...]:
        """Which of the problem's candidates are there."""
        return self.learnt.free

    def less(self, allowance: float) -> Hypothesis:
        """The same with so much less evidence for the cause that was added last, which leaves something open [nats]."""
        problem = self.problem.with_allowance(self.causes[-1].key, allowance)
        return Hypothesis(replace(self.learnt, problem=problem, log_evidence=self.learnt.log_evidence - allowance))

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
        odds = sum(log_prior_odds(self.problem, candidate) for candidate in self.causes)
        return self.learnt.log_evidence + odds - sum(self._tolerated(i) for i in self.free)

    def _tolerated(self, index: int) -> float:
        """What an event of its tolerance would explain, which is none [nats]."""
        candidate = self.problem.candidates[index]
        if candidate.transient is None or not candidate.parameters[0].tolerance:
            return 0.0
        values, covariance = self.fit.part(index)
        information = np.linalg.inv(covariance)
        return log_evidence_of(information, information @ values, 1.0)

    def without(self, index: int) -> Hypothesis:
        """The hypothesis that one of the causes is not there."""
        kept = [i for i in self.free if i != index]
        keys = {self.problem.candidates[i].key for i in kept}
        return Hypothesis.of(self.problem.without_unknowns(keys), kept)

    def possible(self, rig: Rig, index: int) -> bool:
        """Whether one of the causes has values that can be."""
        candidate = self.problem.candidates[index]
        values, covariance = self.fit.part(index)
        units = candidate.units
        return rig.possible(candidate, values * units, covariance * units[:, None] * units)
