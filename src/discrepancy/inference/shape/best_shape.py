"""The shape that suits a cause best; numbers of it that the data determine, and their standard errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from discrepancy import rules
from discrepancy.candidate import Candidate
from discrepancy.inference.scan import Scanned, scores_with
from discrepancy.least_squares.fit import Fit
from discrepancy.least_squares.problem import Problem
from discrepancy.rig import Rig
from estimator.arrays import Array


def best_shape(rig: Rig, problem: Problem, free: Sequence[int], item: Scanned) -> Candidate:
    """The shape that the data make likeliest beside what is there, ever finer around the best."""
    start = item.candidate
    shapes = rig.refinements(start)
    if not shapes and not rig.further(start):
        return start
    fit, spike = Fit.of(problem, free), 0.0
    if item.index is not None and problem.has_tolerance(item.index):
        # What it would add to a model without it: no need to build the problem anew for every shape.
        # Held against none at all: a kind that scatters for want of the right shape would hide that in any.
        fit = Fit.of(problem, free, fixed=(item.index, np.zeros(len(start.parameters))))
    if start.transient and start.parameters[0].tolerance:
        spike = 1.0
    search = _Search(rig, fit, spike)
    best = search.refined(shapes, *search.scored([start]))
    if start.cause in rig.coarse:
        return search.of_far_apart(*best)[0]
    best = search.polished(*best, rules.POLISH_ROUNDS)
    if start.cause in rig.plain_first and best[1] <= 0.0:
        return best[0]
    further = rig.further(best[0])
    return search.polished(*search.refined(further, best), rules.POLISH_ROUNDS)[0] if further else best[0]


_Scored = tuple[Candidate, float]


@dataclass(frozen=True, eq=False)
class _Search:
    """Goes from shape to shape of a candidate.

    Attributes:
        rig: for columns of other shapes.
        fit: without the candidate.
        spike: spread of a healthy one, in tolerances.
    """

    rig: Rig
    fit: Fit
    spike: float

    def scored(self, shapes: Sequence[Candidate]) -> list[_Scored]:
        """Shapes, and how likely each is [nats]."""
        found: list[_Scored] = []
        for first in range(0, len(shapes), rules.SHAPES_AT_A_TIME):
            some = shapes[first : first + rules.SHAPES_AT_A_TIME]
            each = [(shape, self.rig.columns(shape)) for shape in some]
            found += zip(some, scores_with(self.fit, each, self.spike), strict=True)
        return found

    def refined(self, shapes: Sequence[Candidate], start: _Scored) -> _Scored:
        """A better one among some shapes, or among finer ones around it."""
        best = start
        around: _Scored | None = None  # whose finer ones are looked at
        for _ in range(rules.FINER_ROUNDS + 1):
            if not shapes:
                break
            best = self._likeliest((best, *self.scored(shapes)))
            if best is around:
                break
            around, shapes = best, self.rig.refinements(best[0], finer=True)
        return best

    def polished(self, best: Candidate, score: float, rounds: int) -> _Scored:
        """By Gauss-Newton steps, as long as they make it likelier."""
        for _ in range(rounds if self.rig.steps(best) else 0):
            values = self._solution(best)[0] * best.units
            ((nearer, judged),) = self.scored([nearest_shape(self.rig, self.fit, best, values)])
            if judged <= score or (
                self._bounded(nearer) and self._possible(best) and not self._possible(nearer)
            ):
                break
            best, score = nearer, judged
        return best, score

    def _bounded(self, candidate: Candidate) -> bool:
        return candidate.cause in self.rig.rigid

    def _likeliest(self, each: Sequence[_Scored]) -> _Scored:
        """The likeliest; of what has values in some shapes only that can be, among these, if there are any.

        A mass a little off its place gets an inertia that none has, and fits as well.
        """
        ranked = sorted(each, key=_score, reverse=True)
        if not self._bounded(ranked[0][0]):
            return ranked[0]
        return next((one for one in ranked if self._possible(one[0])), ranked[0])

    def of_far_apart(self, best: Candidate, score: float) -> _Scored:
        """The likeliest that steps lead to from any of the shapes that are far apart."""
        least = rules.COARSE_SHARE * score if score > 0.0 else score
        others: list[_Scored] = []
        for lead, first in self._leads(self.scored(self.rig.further(best))):
            if first <= least:
                break
            ends = [self.polished(lead, first, rules.LEAD_ROUNDS)]
            if near := self.scored(self.rig.refinements(ends[0][0], finer=True)):
                ends.append(self.polished(*max(near, key=_score), rules.LEAD_ROUNDS))
            best, score = self._likelier(ends, best, score)
            others += ends
        best, score = self.polished(best, score, rules.LEAD_ROUNDS)
        # What cannot grow may be likelier than what can, and not than what becomes of that: a spring than a cable.
        others = sorted(others, key=_score, reverse=True)
        start = next((one for one in ((best, score), *others) if self.rig.grown(one[0])), None)
        if start is None:
            return best, score
        ends = [self.polished(grown, start[1], rules.LEAD_ROUNDS) for grown in self.rig.grown(start[0])]
        return self._likelier(ends, best, score)

    def _likelier(self, ends: Sequence[_Scored], best: Candidate, score: float) -> _Scored:
        """The best so far, or one of some others where that is likelier and can be."""
        for other, judged in ends:
            if judged > score and self._possible(other):
                best, score = other, judged
        return best, score

    def _leads(self, shapes: Sequence[_Scored]) -> list[_Scored]:
        """The likeliest of every kind, the likeliest kinds first.

        Kinds differ in numbers that the data do not determine: no steps lead from one to another.
        """
        leads: dict[tuple[float, ...], _Scored] = {}
        for shape, score in sorted(shapes, key=_score, reverse=True):
            numbers, steps = shape.shape, [less.shape for less, _, _ in self.rig.steps(shape)]
            fixed = [name for name in sorted(numbers) if all(numbers[name] == less[name] for less in steps)]
            leads.setdefault(tuple(numbers[name] for name in fixed), (shape, score))
        return list(leads.values())[: rules.LEADS]

    def _possible(self, candidate: Candidate) -> bool:
        """Whether its values can be."""
        (values, covariance), units = self._solution(candidate), candidate.units
        return self.rig.possible(candidate, values * units, covariance * units[:, None] * units)

    def _solution(self, candidate: Candidate) -> tuple[Array, Array]:
        return self.fit.solution_with([c * candidate.units for c in self.rig.columns(candidate)])


def _score(one: _Scored) -> float:
    return one[1]


def covariance_with_shape(rig: Rig, fit: Fit, index: int) -> Array:
    """Covariance of a named cause's values, then of what the data determine of its shape, in their own units.

    To first order: slopes of its columns by the numbers of its shape are further columns.

    Args:
        rig: for columns of other shapes.
        fit: the last fit, in which the cause is free.
        index: which candidate.
    """
    problem, candidate = fit.problem, fit.problem.candidates[index]
    values, covariance = fit.part(index)
    units = candidate.units
    if not rig.steps(candidate):
        return np.asarray(covariance * np.outer(units, units))
    others = [i for i in fit.free if i != index]
    without = Fit.of(problem, others, fixed=(index, np.zeros(len(values))))
    return without.solution_with(_with_slopes(rig, candidate, values * units))[1]


def nearest_shape(rig: Rig, without: Fit, candidate: Candidate, values: Array) -> Candidate:
    """The candidate with its shape one Gauss-Newton step nearer to the best; no further than the slopes reach.

    Args:
        rig: for columns of other shapes.
        without: a fit without the candidate.
        candidate: with a shape that is nearly the best.
        values: its parameters, in their own units.
    """
    solution = without.solution_with(_with_slopes(rig, candidate, values))[0]
    found = solution[len(values) :]
    shape = dict(candidate.shape)
    for (less, more, difference), step in zip(rig.steps(candidate), found, strict=True):
        (name,) = (n for n in shape if less.shape[n] != more.shape[n])
        reach = max(difference, candidate.shape.get("ramp_s", 0.0)) / 2
        shape[name] += float(np.clip(step, -reach, reach))
    if "duration_s" in shape:
        shape["duration_s"] = max(shape["duration_s"], rules.EVENT_SHORTEST_S)
    if "ramp_s" in shape:  # an event has grown before it fades
        shape["ramp_s"] = min(
            max(shape["ramp_s"], 0.5 * candidate.shape["ramp_s"]), 0.5 * shape["duration_s"]
        )
    return rig.recentred(candidate.in_shape(shape), solution[: len(values)])


def _with_slopes(rig: Rig, candidate: Candidate, values: Array) -> Sequence[Array]:
    """Columns of a candidate, and their change by every number of its shape, (n, C, k + s) per trial."""
    parts = [rig.columns(candidate)]
    for less, more, difference in rig.steps(candidate):
        ends = zip(rig.columns(less), rig.columns(more), strict=True)
        parts.append([((b - a) @ values / difference)[..., None] for a, b in ends])
    return [np.concatenate(trial, axis=2) for trial in zip(*parts, strict=True)]
