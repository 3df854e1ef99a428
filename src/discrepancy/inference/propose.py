"""Which causes could be added to a hypothesis: each at its best shape, the likeliest first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from discrepancy import rules
from discrepancy.inference.best_shape import nearest_shape
from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.inference.imitation import imitated
from discrepancy.inference.scan import Scanned, scan, score_of, score_with
from discrepancy.least_squares.fit import Fit
from discrepancy.least_squares.problem import Problem
from discrepancy.rig import Candidate, Rig


@dataclass(frozen=True, eq=False)
class Proposed:
    """Hypotheses with one cause more.

    Attributes:
        best: the likeliest; the added cause is the last of its ``free``. None where none is possible.
        scores: what is added, in its shape, and how likely that is [nats], the likeliest first.
    """

    best: Hypothesis | None
    scores: tuple[tuple[Candidate, float], ...]


def proposals(rig: Rig, base: Hypothesis, *, events: bool = True) -> Proposed:
    """Hypotheses with one cause more.

    Args:
        rig: for columns of other shapes.
        base: what is there already.
        events: whether to look for what acts for a while, too.
    """
    fit = base.fit
    ranked = [_in_best_shape(rig, fit, item) for item in _with_kinds_held(base)]
    ranked += _events(rig, fit) if events else []
    ranked.sort(key=lambda item: -item.score)
    best, scores = None, []  # each has its own columns: all together would be gigabytes
    for item in _chosen(ranked, rules.LEADERS):
        near = item.score > ranked[0].score - rules.CLOSE_NATS
        new = _sharpened(rig, base, item, near=near)
        if new.possible(rig, new.free[-1]) and not imitated(rig, base, new.causes[-1]):
            scores.append((new.causes[-1], new.score))
            if best is None or new.score > best.score:
                best = new
    return Proposed(best, tuple(sorted(scores, key=lambda one: -one[1])))


def _with_kinds_held(base: Hypothesis) -> list[Scanned]:
    """The scan; kinds that scatter also within their tolerance: one fault among healthy ones looks like a scatter."""
    problem, found = base.problem, {item.index: item for item in scan(base.fit)}
    kinds: dict[str, list[int]] = {}
    for index, candidate in enumerate(problem.candidates):
        if index not in base.free and problem.has_tolerance(index):
            kinds.setdefault(candidate.cause, []).append(index)
    for members in kinds.values():
        if problem.spread[problem.columns_of(members[0])][0] > rules.HELD_FACTOR:
            spread = problem.spread.copy()
            for index in members:
                spread[problem.columns_of(index)] = 1.0
            fit = Fit.of(replace(problem, spread=spread), base.free)
            for index in members:
                score = score_of(fit, index)
                if score > found[index].score:
                    found[index] = Scanned(index, problem.candidates[index], score)
    return list(found.values())


def _chosen(ranked: Sequence[Scanned], leaders: int) -> list[Scanned]:
    """The likeliest of all, and of every other cause that may be there its likeliest place."""
    likely = [item for item in ranked if item.score > rules.LOOKED_AT_NATS]
    chosen, kinds = likely[:leaders], {item.candidate.cause for item in likely[:leaders]}
    for item in likely[leaders:]:
        if item.candidate.cause not in kinds:
            kinds.add(item.candidate.cause)
            chosen.append(item)
    return chosen[: 2 * leaders]


def _in_best_shape(rig: Rig, fit: Fit, item: Scanned) -> Scanned:
    """An event without a tolerance in the shape that tells most: in another it may not be seen at all."""
    if item.index is None or fit.problem.has_tolerance(item.index):
        return item
    best = item
    for shape in rig.refinements(item.candidate):
        columns = tuple(rig.columns(shape))
        score = score_with(fit, shape, columns)
        if score > best.score:
            best = Scanned(item.index, shape, score, columns)
    return best


def _events(rig: Rig, fit: Fit) -> list[Scanned]:
    """What acts for a while, at the intervals where what is left is worst."""
    there = [fit.problem.candidates[i] for i in fit.free]
    found = []
    for candidate in rig.transients([fit.remaining(t) for t in fit.problem.trials]):
        # What is left of an event that is there is its form, and no other event.
        if not any(candidate.overlaps(other) for other in there):
            columns = tuple(rig.columns(candidate))
            score = score_with(fit, candidate, columns, 1.0 if candidate.parameters[0].tolerance else 0.0)
            found.append(Scanned(None, candidate, score, columns))
    return sorted(found, key=lambda item: -item.score)[: rules.WORST_EVENTS]


def _sharpened(rig: Rig, base: Hypothesis, item: Scanned, *, near: bool) -> Hypothesis:
    """A candidate beside what is there, in its best shape where it is near the likeliest, and with what it opens."""
    shaped = _best_shape(rig, base, item) if near else item.candidate
    problem, index = _with(rig, base.problem, shaped, item)
    new = Hypothesis.of(problem, [*base.free, index], base.allowed)
    return _beyond_tolerance(base, problem, new) if shaped.transient else _opened(rig, base, problem, new)


def _beyond_tolerance(base: Hypothesis, problem: Problem, new: Hypothesis) -> Hypothesis:
    """An event without the credit for what one within its tolerance, which is none, would explain."""
    index = new.free[-1]
    if not problem.candidates[index].parameters[0].tolerance:
        return new
    healthy = Hypothesis.of(problem.tolerating(index), base.free, base.allowed)
    return replace(new, allowed={**new.allowed, index: max(0.0, healthy.score - base.score)})


def _opened(rig: Rig, base: Hypothesis, problem: Problem, new: Hypothesis) -> Hypothesis:
    """With what the added cause leaves open, where that is likelier.

    What is open explains some of what healthy ones leave, too; that much is not to the cause's credit.
    """
    index = new.free[-1]
    shaped = problem.candidates[index]
    unknowns = rig.unknowns(shaped)
    if not any(u.shape[2] for u in unknowns):
        return new
    size = abs(float(new.fit.part(index)[0][0] * shaped.units[0]))
    start = problem.with_noise(new.problem.power, new.problem.spread)
    # Its size is found with them, and is theirs.
    first = start.with_unknowns(shaped.key, unknowns, max(size, shaped.parameters[0].tolerance))
    size = abs(float(Hypothesis.of(first, new.free, base.allowed).fit.part(index)[0][0] * shaped.units[0]))
    del first  # for the sake of memory
    opened = start.with_unknowns(shaped.key, unknowns, max(size, shaped.parameters[0].tolerance))
    other = Hypothesis.of(opened, new.free, base.allowed)
    if other.score <= new.score:
        return new
    healthy = Hypothesis.of(opened, base.free, base.allowed)
    return replace(other, allowed={**base.allowed, index: max(0.0, healthy.score - base.score)})


def _with(rig: Rig, problem: Problem, shaped: Candidate, item: Scanned) -> tuple[Problem, int]:
    """The problem with a candidate in a shape, and which candidate it is."""
    if item.index is None:
        return problem.extended(shaped, rig.columns(shaped)), len(problem.candidates)
    if shaped is problem.candidates[item.index]:
        return problem, item.index
    return problem.with_columns(item.index, shaped, rig.columns(shaped)), item.index


def _best_shape(rig: Rig, base: Hypothesis, item: Scanned) -> Candidate:
    """The shape that the data make likeliest, ever finer around the best."""
    problem, fit, spike = base.problem, base.fit, 0.0
    if item.index is not None and problem.has_tolerance(item.index):
        # What it would add to a model without it: no need to build the problem anew for every shape.
        fit = Fit.of(problem, base.free, fixed=(item.index, np.zeros(len(item.candidate.parameters))))
        spike = float(problem.spread[problem.columns_of(item.index)][0])
    start = item.candidate
    if start.transient and start.parameters[0].tolerance:
        spike = 1.0
    shapes = [*rig.refinements(start)]
    if not shapes:
        return start
    best, score = start, score_with(fit, start, rig.columns(start), spike)
    for _ in range(rules.FINER_ROUNDS + 1):
        last = best
        for shape in shapes:
            judged = score_with(fit, shape, rig.columns(shape), spike)
            if judged > score:
                best, score = shape, judged
        if best is last and best is not start:
            break
        shapes = rig.refinements(best, finer=True)
        if not shapes:
            break
    for _ in range(rules.POLISH_ROUNDS if rig.steps(best) else 0):
        values = fit.solution_with([c * best.units for c in rig.columns(best)])[0] * best.units
        nearer = nearest_shape(rig, fit, best, values)
        judged = score_with(fit, nearer, rig.columns(nearer), spike)
        if judged <= score:
            break
        best, score = nearer, judged
    return best
