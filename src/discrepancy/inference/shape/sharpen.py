"""A candidate in its best shape beside what is there, and with what it leaves open."""

from __future__ import annotations

from dataclasses import replace

from discrepancy import rules
from discrepancy.candidate import Candidate
from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.inference.scan import Scanned
from discrepancy.inference.shape.best_shape import best_shape
from discrepancy.inference.shape.reshape import as_plain, event_in_shape, in_shape, settled_shape
from discrepancy.least_squares.problem import Problem
from discrepancy.rig import Rig


def sharpened(
    rig: Rig, base: Hypothesis, item: Scanned, *, near: bool, start: Problem | None = None,
    shape: Candidate | None = None,
) -> Hypothesis:  # fmt: skip
    """A candidate beside what is there, in its best shape where it is near the likeliest, and with what it opens.

    Args:
        rig: for columns of other shapes.
        base: what is there already.
        item: the candidate.
        near: whether it is near the likeliest.
        start: the problem with the spreads and powers from which those with the candidate are learnt; None for base's.
        shape: near which its best shape is, where that is known; otherwise None.
    """
    start = base.problem if start is None else start
    if near and item.candidate.transient and rig.steps(item.candidate):
        new = event_in_shape(rig, base, start, item.candidate)
        return _beyond_tolerance(base, new.problem, new)
    tried = [item.candidate]
    if near and shape is not None:
        tried = [shape]
    elif near:
        tried = [best_shape(rig, start, base.free, item)]
        if (held := _with_kind_held(start, item)) is not None:
            # The others of a kind that scatters to explain this one take its shape from it.
            tried.append(best_shape(rig, held, base.free, item))
    new = max((_in_shape(rig, base, start, item, shape, near) for shape in tried), key=lambda one: one.score)
    if new.causes[-1].transient:
        return _beyond_tolerance(base, new.problem, new)
    if near:
        new = as_plain(rig, new, new.free[-1])
    new = _opened(rig, base, new.problem, new)
    for shape in _apart(rig, new.causes[-1]) if near else ():
        other = _in_shape(rig, base, start, item, shape, near)
        other = _opened(rig, base, other.problem, other)
        if other.score > new.score + rules.SHAPE_NATS:
            new = other
    return new


def _apart(rig: Rig, candidate: Candidate) -> list[Candidate]:
    """The candidate in shapes that leave something else open, beside which alone they can be held against its own."""
    names = [name for name in rig.apart if name not in candidate.shape]
    return [shape for shape in rig.refinements(candidate) if any(name in shape.shape for name in names)]


def _with_kind_held(problem: Problem, item: Scanned) -> Problem | None:
    """The problem with a candidate's kind within its tolerance; None where it is, or has none."""
    if item.index is None or not problem.has_tolerance(item.index):
        return None
    if problem.spread[problem.columns_of(item.index)][0] <= rules.HELD_FACTOR:
        return None
    spread = problem.spread.copy()
    for index, other in enumerate(problem.candidates):
        if other.cause == item.candidate.cause and problem.has_tolerance(index):
            spread[problem.columns_of(index)] = 1.0
    return replace(problem, spread=spread)


def _in_shape(
    rig: Rig, base: Hypothesis, start: Problem, item: Scanned, shape: Candidate, near: bool
) -> Hypothesis:
    """A candidate in a shape beside what is there; where it is near the likeliest, in the nearest that suits best."""
    problem, index = _with(rig, start, shape, item)
    new = Hypothesis.of(problem, [*base.free, index], base.allowed)
    return settled_shape(rig, new, index) if near and not shape.transient else new


def _beyond_tolerance(base: Hypothesis, problem: Problem, new: Hypothesis) -> Hypothesis:
    """An event without the credit for what one within its tolerance, which is none, would explain."""
    index = new.free[-1]
    if not problem.candidates[index].parameters[0].tolerance:
        return new
    healthy = Hypothesis.of(problem.tolerating(index), base.free, base.allowed)
    return replace(new, allowed={**new.allowed, index: max(0.0, healthy.score - base.score)})


def _opened(rig: Rig, base: Hypothesis, problem: Problem, new: Hypothesis) -> Hypothesis:
    """With what the added cause leaves open, where that is likelier.

    What is open explains some of what healthy ones leave, too; that much is not to the cause's credit. What the cause
    explains with nothing open stays to it.
    """
    index = new.free[-1]
    shaped = problem.candidates[index]
    start = problem.with_noise(new.problem.power, new.problem.spread)
    along, opened, other = start.along(rig.unknowns(shaped)), start, new
    if not any(len(one.opened.stretch) for one in along):
        return new
    last = 0.0
    for _ in range(2):  # its size is found with them, and is theirs
        size = max(abs(float(other.fit.part(index)[0][0] * shaped.units[0])), shaped.parameters[0].tolerance)
        if abs(size - last) < rules.SIZE_SETTLED * size:
            break
        last, opened, other = size, start, new  # the last ones go first, for the sake of memory
        opened = start.with_open(shaped.key, along, size)
        other = Hypothesis.of(opened, new.free, base.allowed)
    if other.score <= new.score:
        return new
    healthy = Hypothesis.of(opened, base.free, base.allowed)
    allowed = min(max(0.0, healthy.score - base.score), other.score - new.score)
    return _reshaped(rig, replace(other, allowed={**base.allowed, index: allowed}))


def _reshaped(rig: Rig, new: Hypothesis) -> Hypothesis:
    """The last cause in another shape, if that shows beside what it leaves open (``Rig.behind``)."""
    index, candidate = new.free[-1], new.causes[-1]
    for shape in rig.refinements(candidate) if candidate.cause in rig.behind else ():
        other = settled_shape(rig, in_shape(rig, new, index, shape), index)
        if other.score > new.score + rules.SHAPE_NATS and other.possible(rig, index):
            new = other
    return new


def _with(rig: Rig, problem: Problem, shaped: Candidate, item: Scanned) -> tuple[Problem, int]:
    """The problem with a candidate in a shape, and which candidate it is."""
    if item.index is None:
        return problem.extended(shaped, rig.columns(shaped)), len(problem.candidates)
    if shaped is problem.candidates[item.index]:
        return problem, item.index
    if problem.has_tolerance(item.index) and shaped.cause in rig.shaped:
        # What is normal stays as it is, and the fault of another shape comes beside it.
        parameters = tuple(replace(p, tolerance=0.0) for p in shaped.parameters)
        shaped = replace(shaped, parameters=parameters)
        return problem.extended(shaped, rig.columns(shaped)), len(problem.candidates)
    return problem.with_columns(item.index, shaped, rig.columns(shaped)), item.index
