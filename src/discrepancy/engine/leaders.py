"""Candidates at their best: with the shape that fits, and with what they leave open."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from discrepancy import rules
from discrepancy.engine.best_shape import nearest_shape
from discrepancy.least_squares.fit import Evidence, Fit
from discrepancy.least_squares.problem import Problem
from discrepancy.rig import Candidate, Rig

Array = NDArray[np.float64]


Shaped = tuple[Evidence, Candidate, list[Array]]
"""A candidate in one shape: its evidence and its columns."""


@dataclass(frozen=True, eq=False)
class Leader:
    """A candidate at its best: with its best shape, and with what it leaves open.

    Attributes:
        evidence: that its parameters leave their tolerance.
        problem: the problem with that shape and those unknowns.
        misfit: chi-square with its parameters free, plus the penalty for them and for its unknowns.
    """

    evidence: Evidence
    problem: Problem
    misfit: float

    @property
    def candidate(self) -> Candidate:
        """Cause, place and shape."""
        return self.problem.candidates[self.evidence.index]


def leaders(
    rig: Rig, problem: Problem, free: Sequence[int], evidence: Sequence[Evidence], inflation: float
) -> list[Leader]:
    """Significant candidates at their best, the least misfit first."""
    significant = [e for e in evidence if log10_p(problem, e) <= rules.SIGNIFICANT_LOG10_P][: rules.LEADERS]
    found = []
    for first in significant:
        index = first.index
        best = _sharpened(rig, problem, free, index, inflation)
        if best is None or log10_p(best.problem, best.evidence) > rules.SIGNIFICANT_LOG10_P:
            continue
        values, covariance = best.problem.fit([*free, index]).part(index)
        units = best.candidate.units
        if rig.possible(best.candidate, values * units, covariance * np.outer(units, units)):
            found.append(best)
    return sorted(found, key=lambda leader: leader.misfit)


def _sharpened(
    rig: Rig, problem: Problem, free: Sequence[int], index: int, inflation: float
) -> Leader | None:
    """A candidate in its best shape: the catalogue's first, then ever finer around the best."""
    start = problem.candidates[index]
    if not start.transient and any(u.shape[2] for u in rig.unknowns(start)):
        return _best_with_unknowns(rig, problem, free, index, inflation)
    # What it would add to a model without it: no need to build the problem anew for every shape.
    without = problem.fit(free, fixed=(index, np.zeros(len(start.parameters))))
    best: Shaped | None = None
    shapes = [start, *rig.refinements(start)]
    for _ in range(rules.FINER_ROUNDS + 1):
        last = best
        for shape in shapes:
            columns = rig.columns(shape)
            judged = without.evidence_with(index, columns, inflation)
            if judged is not None and (best is None or judged.fall > best[0].fall):
                best = judged, shape, columns
        if best is None or best is last:
            break
        shapes = rig.refinements(best[1], finer=True)
    if best is None:
        return None
    best = _polished(rig, without, best, inflation)
    evidence, shape, columns = best
    changed = problem if shape is start else problem.with_columns(index, shape, columns)
    penalty = rules.COMPLEXITY * np.log(problem.samples) * evidence.parameters
    return Leader(evidence, changed, without.misfit - evidence.fall + penalty)


def _polished(rig: Rig, without: Fit, best: Shaped, inflation: float) -> Shaped:
    """The best of a grid of shapes, moved to where the data want it."""
    for _ in range(rules.POLISH_ROUNDS if rig.steps(best[1]) else 0):
        evidence, shape, _ = best
        nearer = nearest_shape(rig, without, shape, evidence.values * shape.units)
        columns = rig.columns(nearer)
        judged = without.evidence_with(evidence.index, columns, inflation)
        if judged is None or judged.fall <= evidence.fall:
            break
        best = judged, nearer, columns
    return best


def _best_with_unknowns(
    rig: Rig, problem: Problem, free: Sequence[int], index: int, inflation: float
) -> Leader | None:
    """The same for a candidate that leaves something open in every trial, such as friction at rest.

    What it leaves open stays in the model, but it is ranked without the price of that where the price is too high:
    friction that is all viscous is nothing at rest, and a hundred open knots would cost more than it explains.
    """
    start = problem.candidates[index]
    best: Leader | None = None
    for shape in (start, *rig.refinements(start)):
        changed = problem
        if shape is not start:
            changed = problem.with_columns(index, shape, rig.columns(shape))
        unknowns = rig.unknowns(shape)
        opened = changed.with_unknowns(unknowns)
        judged = opened.fit(free).evidence_of(index, inflation)
        if judged is None:
            continue
        price = rules.COMPLEXITY * np.log(problem.samples)
        misfit = price * judged.parameters + min(
            opened.fit([*free, index]).misfit + price * sum(u.shape[2] for u in unknowns),
            changed.fit([*free, index]).misfit,
        )
        if best is None or misfit < best.misfit:
            best = Leader(judged, opened, misfit)
    return best


def in_best_shapes(rig: Rig, problem: Problem, fit: Fit) -> Problem:
    """Events in the shape that tells most of what is left: in another they may not be seen at all.

    A cause with a tolerance keeps its shape, since it is in the model.
    """
    for index, candidate in enumerate(problem.candidates):
        if index in fit.free or candidate.transient or any(p.tolerance > 0 for p in candidate.parameters):
            continue
        best = fit.evidence_of(index)
        chosen: tuple[Candidate, list[Array]] | None = None
        for shape in rig.refinements(candidate):
            columns = rig.columns(shape)
            judged = fit.evidence_with(index, columns)
            if judged is not None and (best is None or judged.gain > best.gain):
                best, chosen = judged, (shape, columns)
        if chosen is not None:
            problem = problem.with_columns(index, *chosen)
    return problem


def with_transients(
    rig: Rig, problem: Problem, fit: Fit, evidence: list[Evidence], inflation: float
) -> tuple[Problem, list[Evidence]]:
    """Add the best transient to the problem."""
    best: tuple[float, Problem] | None = None
    for candidate in rig.transients([fit.remaining(t) for t in range(len(problem.rows))]):
        if any(c.transient and c.transient == candidate.transient for c in problem.candidates):
            continue
        wider = problem.extended(candidate, rig.columns(candidate))
        last = len(wider.candidates) - 1
        misfit = wider.fit([*fit.free, last]).misfit
        if best is None or misfit < best[0]:
            best = (misfit, wider)
    if best is None:
        return problem, evidence
    return best[1], best[1].fit(fit.free).evidence(inflation)


def log10_p(problem: Problem, evidence: Evidence) -> float:
    """Of so much evidence by chance; that of a transient also pays for the intervals searched."""
    transient = problem.candidates[evidence.index].transient is not None
    return evidence.log10_p + (rules.INTERVALS_LOG10 if transient else 0.0)
