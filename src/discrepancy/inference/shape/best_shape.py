"""The shape that suits a cause best; numbers of it that the data determine, and their standard errors."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from discrepancy import rules
from discrepancy.candidate import Candidate
from discrepancy.inference.scan import Scanned, score_with, scores_with
from discrepancy.least_squares.fit import Fit
from discrepancy.least_squares.problem import Problem
from discrepancy.rig import Rig
from estimator.arrays import Array


def best_shape(rig: Rig, problem: Problem, free: Sequence[int], item: Scanned) -> Candidate:
    """The shape that the data make likeliest beside what is there, ever finer around the best."""
    fit, spike = Fit.of(problem, free), 0.0
    if item.index is not None and problem.has_tolerance(item.index):
        # What it would add to a model without it: no need to build the problem anew for every shape.
        # Held against none at all: a kind that scatters for want of the right shape would hide that in any.
        fit = Fit.of(problem, free, fixed=(item.index, np.zeros(len(item.candidate.parameters))))
    start = item.candidate
    if start.transient and start.parameters[0].tolerance:
        spike = 1.0
    shapes = [*rig.refinements(start)]
    if not shapes and not rig.further(start):
        return start
    best, score = start, score_with(fit, start, rig.columns(start), spike)

    def refined(shapes: Sequence[Candidate], best: Candidate, score: float) -> tuple[Candidate, float]:
        """A better one among some shapes, or among finer ones around it."""
        for _ in range(rules.FINER_ROUNDS + 1):
            if not shapes:
                break
            last = best
            each = [(shape, rig.columns(shape)) for shape in shapes]
            for (shape, _), judged in zip(each, scores_with(fit, each, spike), strict=True):
                if judged > score:
                    best, score = shape, judged
            if best is last and best is not start:
                break
            shapes = rig.refinements(best, finer=True)
        return best, score

    def polished(best: Candidate, score: float, rounds: int) -> tuple[Candidate, float]:
        """By Gauss-Newton steps, as long as they make it likelier."""
        for _ in range(rounds if rig.steps(best) else 0):
            values = fit.solution_with([c * best.units for c in rig.columns(best)])[0] * best.units
            nearer = nearest_shape(rig, fit, best, values)
            judged = score_with(fit, nearer, rig.columns(nearer), spike)
            if judged <= score:
                break
            best, score = nearer, judged
        return best, score

    best, score = refined(shapes, best, score)
    if start.cause not in rig.coarse:
        return polished(*refined(rig.further(best), best, score), rules.POLISH_ROUNDS)[0]
    each = [(shape, rig.columns(shape)) for shape in rig.further(best)]
    least = rules.COARSE_SHARE * score if score > 0.0 else score
    for lead, first in _leads(rig, [s for s, _ in each], scores_with(fit, each, spike)):
        lead, first = polished(lead, first, rules.LEAD_ROUNDS) if first > least else (lead, first)
        if first > score and _possible(rig, fit, lead):
            best, score = lead, first
    return polished(best, score, rules.LEAD_ROUNDS)[0]


def _possible(rig: Rig, fit: Fit, candidate: Candidate) -> bool:
    """Whether such values can be as a candidate would have beside what is there."""
    values, covariance = fit.solution_with([c * candidate.units for c in rig.columns(candidate)])
    units = candidate.units
    return rig.possible(candidate, values * units, covariance * units[:, None] * units)


def _leads(
    rig: Rig, shapes: Sequence[Candidate], scores: Sequence[float]
) -> Sequence[tuple[Candidate, float]]:
    """Of some shapes the likeliest of every kind, the likeliest kinds first.

    Kinds differ in numbers that the data do not determine: no steps lead from one to another.
    """
    leads: dict[tuple[object, ...], tuple[Candidate, float]] = {}
    for shape, score in sorted(zip(shapes, scores, strict=True), key=lambda one: -one[1]):
        numbers = shape.shape
        steps = [less.shape for less, _, _ in rig.steps(shape)]
        fixed = {name for name in numbers if all(numbers[name] == less[name] for less in steps)}
        leads.setdefault(tuple(numbers[name] for name in sorted(fixed)), (shape, score))
    return list(leads.values())[: rules.LEADS]


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
    found = without.solution_with(_with_slopes(rig, candidate, values))[0][len(values) :]
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
    return candidate.in_shape(shape)


def _with_slopes(rig: Rig, candidate: Candidate, values: Array) -> Sequence[Array]:
    """Columns of a candidate, and their change by every number of its shape, (n, C, k + s) per trial."""
    parts = [rig.columns(candidate)]
    for less, more, difference in rig.steps(candidate):
        ends = zip(rig.columns(less), rig.columns(more), strict=True)
        parts.append([((b - a) @ values / difference)[..., None] for a, b in ends])
    return [np.concatenate(trial, axis=2) for trial in zip(*parts, strict=True)]
