"""Shapes of causes that are there, told from the noise that is left with all of them."""

from __future__ import annotations

import numpy as np

from discrepancy import rules
from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.inference.refit import exact
from discrepancy.inference.scan import scores_with
from discrepancy.least_squares.fit import Fit
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
    if not shapes:
        return hypothesis
    others = [i for i in hypothesis.free if i != index]
    without = Fit.of(problem, others, fixed=(index, np.zeros(len(candidate.parameters))))
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
