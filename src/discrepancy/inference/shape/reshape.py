"""Shapes of causes that are there, told from the noise that is left with all of them."""

from __future__ import annotations

import numpy as np

from discrepancy import rules
from discrepancy.candidate import Candidate
from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.inference.refit import exact
from discrepancy.inference.scan import scores_with
from discrepancy.inference.shape.best_event import all_around, best_event
from discrepancy.inference.shape.best_shape import nearest_shape
from discrepancy.least_squares.fit import Fit
from discrepancy.least_squares.problem import Problem
from discrepancy.rig import Rig


def reshaped(rig: Rig, hypothesis: Hypothesis, nothing: Hypothesis) -> Hypothesis:
    """The hypothesis with every cause in the shape that suits the noise left with all of them, where that is likelier.

    A cause is looked for, and looked at again, with the noise of a model without it: where it explains most of a
    joint's torque its shapes differ by less than that. Of what has a tolerance the shape is the healthy one's, too.

    Args:
        rig: for columns of other shapes.
        hypothesis: what is there.
        nothing: the hypothesis that nothing is.
    """
    for index in hypothesis.free:
        candidate = hypothesis.problem.candidates[index]
        if candidate.transient is None and not candidate.parameters[0].tolerance:
            hypothesis = _in_best_shape(rig, hypothesis, nothing, index)
    return hypothesis


def _in_best_shape(rig: Rig, hypothesis: Hypothesis, nothing: Hypothesis, index: int) -> Hypothesis:
    problem, candidate = hypothesis.problem, hypothesis.problem.candidates[index]
    shapes = [*rig.refinements(candidate), *rig.refinements(candidate, finer=True)]
    if not shapes and not rig.steps(candidate):
        return hypothesis
    others = [i for i in hypothesis.free if i != index]
    without = Fit.of(problem, others, fixed=(index, np.zeros(len(candidate.parameters))))
    if rig.steps(candidate):
        values = hypothesis.fit.part(index)[0] * candidate.units
        shapes.append(nearest_shape(rig, without, candidate, values))
    each = [(one, rig.columns(one)) for one in (candidate, *shapes)]
    own, *scores = scores_with(without, each)
    best = int(np.argmax(scores))
    if scores[best] < own + rules.EXCHANGED_NATS:
        return hypothesis
    turned = Hypothesis.of(
        problem.with_columns(index, shapes[best], each[best + 1][1]), hypothesis.free, hypothesis.allowed
    )
    if not turned.possible(rig, index):
        return hypothesis
    turned = exact(rig, turned, nothing)
    return turned if turned.score > hypothesis.score + rules.EXCHANGED_NATS else hypothesis


def settled_shape(rig: Rig, new: Hypothesis, index: int) -> Hypothesis:
    """One of the causes in the shape that suits the noise left with it; without it, all misfit counted as noise."""
    for _ in range(rules.SETTLE_ROUNDS if rig.steps(new.problem.candidates[index]) else 0):
        values, candidate = new.fit.part(index)[0], new.problem.candidates[index]
        others = [i for i in new.free if i != index]
        without = Fit.of(new.problem, others, fixed=(index, np.zeros(len(values))))
        moved = nearest_shape(rig, without, candidate, values * candidate.units)
        other = in_shape(rig, new, index, moved)
        if other.score <= new.score:
            break
        if candidate.cause in rig.rigid and new.possible(rig, index) and not other.possible(rig, index):
            break
        gained, new = other.score - new.score, other
        if gained < rules.SETTLED_NATS:
            break
    return new


def as_plain(rig: Rig, new: Hypothesis, index: int) -> Hypothesis:
    """One of the causes in its plain shape, unless more to it is worth its share of that (``Rig.more_share``).

    Both are held against none at all: where a kind scatters for its sake, it explains little more than that does.
    """
    candidate = new.problem.candidates[index]
    if candidate.cause not in rig.more_share or not candidate.shape:
        return new
    others, plain = [i for i in new.free if i != index], candidate.in_shape({})
    without = Fit.of(new.problem, others, fixed=(index, np.zeros(len(candidate.parameters))))
    more, less = scores_with(without, [(one, rig.columns(one)) for one in (candidate, plain)])
    keeps = more > less + rig.more_share[candidate.cause] * max(less, 0.0)
    return new if keeps else in_shape(rig, new, index, plain)


def in_shape(rig: Rig, new: Hypothesis, index: int, shape: Candidate) -> Hypothesis:
    """The hypothesis with one of its causes in another shape."""
    problem = new.problem.with_columns(index, shape, rig.columns(shape))
    return Hypothesis.of(problem, new.free, new.allowed)


def event_in_shape(rig: Rig, base: Hypothesis, start: Problem, event: Candidate) -> Hypothesis:
    """What is there and an event, in the shape that suits the noise left with it.

    As long as it is not named the noise has the power of what it leaves. In that only its edges show, and a search ends
    wherever one of them is near; in noise as it should be, any overlap helps. Where other things are wrong as well,
    that may take the event for some of them. So both are tried, and each again in the noise that it leaves.
    """
    best: Hypothesis | None = None
    index, around = len(start.candidates), all_around(rig, event)
    loud = any(bool((power > rules.EVENT_LOUD_POWER).any()) for power in start.power)
    for noise in (start.calm, start) if loud else (start,):
        last: Hypothesis | None = None
        for _ in range(rules.POLISH_ROUNDS):
            new = last
            for shape in best_event(Fit.of(noise, base.free), around, rig):
                problem = start.extended(shape, rig.columns(shape))
                other = settled_shape(rig, Hypothesis.of(problem, [*base.free, index], base.allowed), index)
                if new is None or other.score > new.score + (last is not None) * rules.EXCHANGED_NATS:
                    new = other
            if new is None or new is last:
                break
            if not around.within(new.causes[-1]):
                around = all_around(rig, new.causes[-1])
            last, noise = new, start.with_noise(new.problem.power, start.spread)
        if last is not None and (best is None or last.score > best.score):
            best = last
    assert best is not None
    return best
