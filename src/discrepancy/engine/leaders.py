"""Candidates at their best: with the shape that fits, and with what they leave open."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from discrepancy import rules
from discrepancy.engine.best_shape import nearest_shape
from discrepancy.least_squares.evidence import Evidence
from discrepancy.least_squares.fit import Fit
from discrepancy.least_squares.problem import Problem
from discrepancy.rig import Candidate, Rig
from estimator.arrays import Array


@dataclass(frozen=True, eq=False)
class Shaped:
    """A candidate in one shape: its evidence and its columns, shape (n, C, k) per trial."""

    evidence: Evidence
    candidate: Candidate
    columns: list[Array]


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
    def index(self) -> int:
        """Which candidate of the problem."""
        return self.evidence.index

    @property
    def candidate(self) -> Candidate:
        """Cause, place and shape."""
        return self.problem.candidates[self.index]


def leaders(rig: Rig, fit: Fit, evidence: Sequence[Evidence], inflation: float) -> list[Leader]:
    """Significant candidates at their best beside those that are free, the least misfit first."""
    significant = [e for e in evidence if log10_p(fit.problem, e) <= rules.SIGNIFICANT_LOG10_P]
    found = []
    for first in significant[: rules.LEADERS]:
        best = _sharpened(rig, fit, first.index, inflation)
        if best is None or log10_p(best.problem, best.evidence) > rules.SIGNIFICANT_LOG10_P:
            continue
        values, covariance = Fit.of(best.problem, [*fit.free, best.index]).part(best.index)
        units = best.candidate.units
        if rig.possible(best.candidate, values * units, covariance * np.outer(units, units)):
            found.append(best)
    return sorted(found, key=lambda leader: leader.misfit)


def _sharpened(rig: Rig, fit: Fit, index: int, inflation: float) -> Leader | None:
    """A candidate in its best shape: the catalogue's first, then ever finer around the best."""
    problem = fit.problem
    start = problem.candidates[index]
    if not start.transient and any(u.shape[2] for u in rig.unknowns(start)):
        return _best_with_unknowns(rig, fit, index, inflation)
    # What it would add to a model without it: no need to build the problem anew for every shape.
    without = Fit.of(problem, fit.free, fixed=(index, np.zeros(len(start.parameters))))
    best: Shaped | None = None
    shapes = [start, *rig.refinements(start)]
    for _ in range(rules.FINER_ROUNDS + 1):
        last = best
        for shape in shapes:
            columns = rig.columns(shape)
            judged = without.evidence_with(index, columns, inflation)
            if judged is not None and (best is None or judged.fall > best.evidence.fall):
                best = Shaped(judged, shape, columns)
        if best is None or best is last:
            break
        shapes = rig.refinements(best.candidate, finer=True)
    if best is None:
        return None
    best = _polished(rig, without, best, inflation)
    changed = problem
    if best.candidate is not start:
        changed = problem.with_columns(index, best.candidate, best.columns)
    penalty = price(problem) * best.evidence.parameters
    return Leader(best.evidence, changed, without.misfit - best.evidence.fall + penalty)


def _polished(rig: Rig, without: Fit, best: Shaped, inflation: float) -> Shaped:
    """The best of a grid of shapes, moved to where the data want it."""
    for _ in range(rules.POLISH_ROUNDS if rig.steps(best.candidate) else 0):
        values = best.evidence.values * best.candidate.units
        nearer = nearest_shape(rig, without, best.candidate, values)
        columns = rig.columns(nearer)
        judged = without.evidence_with(best.evidence.index, columns, inflation)
        if judged is None or judged.fall <= best.evidence.fall:
            break
        best = Shaped(judged, nearer, columns)
    return best


def _best_with_unknowns(rig: Rig, fit: Fit, index: int, inflation: float) -> Leader | None:
    """The same for a candidate that leaves something open in every trial, such as friction at rest.

    What it leaves open stays in the model, but it is ranked without the price of that where the price is too high:
    friction that is all viscous is nothing at rest, and a hundred open knots would cost more than it explains.
    """
    start = fit.problem.candidates[index]
    best: Leader | None = None
    for shape in (start, *rig.refinements(start)):
        changed = fit.problem
        if shape is not start:
            changed = changed.with_columns(index, shape, rig.columns(shape))
        unknowns = rig.unknowns(shape)
        opened = changed.with_unknowns(unknowns)
        judged = Fit.of(opened, fit.free).evidence_of(index, inflation)
        if judged is None:
            continue
        each, free = price(changed), [*fit.free, index]
        misfit = each * judged.parameters + min(
            Fit.of(opened, free).misfit + each * sum(u.shape[2] for u in unknowns),
            Fit.of(changed, free).misfit,
        )
        if best is None or misfit < best.misfit:
            best = Leader(judged, opened, misfit)
    return best


def in_best_shapes(rig: Rig, fit: Fit) -> Problem:
    """Events in the shape that tells most of what is left: in another they may not be seen at all.

    A cause with a tolerance keeps its shape, since it is in the model.
    """
    problem = fit.problem
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


def with_transient(rig: Rig, fit: Fit) -> Fit:
    """The same fit with the best transient among the problem's candidates; as it is where there is none."""
    best: tuple[float, Problem] | None = None
    problem = fit.problem
    for candidate in rig.transients([fit.remaining(t) for t in problem.trials]):
        if any(c.transient and c.transient == candidate.transient for c in problem.candidates):
            continue
        wider = problem.extended(candidate, rig.columns(candidate))
        misfit = Fit.of(wider, [*fit.free, len(wider.candidates) - 1]).misfit
        if best is None or misfit < best[0]:
            best = (misfit, wider)
    return fit if best is None else Fit.of(best[1], fit.free)


def price(problem: Problem) -> float:
    """Penalty per parameter, on the scale of chi-square."""
    return float(rules.COMPLEXITY * np.log(problem.samples))


def log10_p(problem: Problem, evidence: Evidence) -> float:
    """Of so much evidence by chance; that of a transient also pays for the intervals searched."""
    transient = problem.candidates[evidence.index].transient is not None
    return evidence.log10_p + (rules.INTERVALS_LOG10 if transient else 0.0)
