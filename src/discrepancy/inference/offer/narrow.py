"""What can be in some shapes only, looked for with every kind within its tolerance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from discrepancy import rules
from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.inference.refit import exact, near
from discrepancy.inference.scan import Scanned, in_best_shape, score_of
from discrepancy.inference.shape.reshape import in_shape
from discrepancy.inference.shape.sharpen import sharpened
from discrepancy.least_squares.fit import Fit
from discrepancy.least_squares.problem import Problem
from discrepancy.rig import Rig


def with_kinds_narrow(rig: Rig, base: Hypothesis, nothing: Hypothesis) -> list[Hypothesis]:
    """What has a shape that the data determine, found with every kind within its tolerance, if any scatters.

    Kinds that scatter to explain a cause take its shape from it: a payload is then whatever masses leave of it. Where
    they have taken it slopes are of a machine with such masses, so it is sought where the model has none of that.

    Args:
        rig: for columns of other shapes.
        base: what is there already.
        nothing: the hypothesis that nothing is.
    """
    rigid = [
        (index, candidate)
        for index, candidate in enumerate(base.problem.candidates)
        if index not in base.free and candidate.cause in rig.rigid and not candidate.hidden
    ]
    if not rigid or not _scattering(base).any():
        return []
    start = _as_modelled(rig, base)
    narrow = replace(start.problem, spread=np.where(_scattering(start), 1.0, start.problem.spread))
    fit, found = Fit.of(narrow, base.free), []
    for index, candidate in rigid:
        item = in_best_shape(rig, fit, Scanned(index, candidate, score_of(fit, index)))
        if item.score > rules.NARROW_NATS:
            new = sharpened(rig, base, item, near=True, start=narrow)
            found.append(_exact(rig, new, nothing) if near(rig, base) else new)
    return found


def _exact(rig: Rig, straight: Hypothesis, nothing: Hypothesis) -> Hypothesis:
    """With exact residuals, and values that can be there: in a shape nearer by if they cannot."""
    new = exact(rig, straight, nothing)
    index = new.free[-1]
    if new.possible(rig, index):
        return new
    for shape in rig.closer(new.causes[-1]):
        other = exact(rig, in_shape(rig, straight, index, shape), nothing)
        if other.possible(rig, index):
            return other
    return new


def _scattering(base: Hypothesis) -> NDArray[np.bool_]:
    """Which columns are of kinds that scatter, of all candidates' ones."""
    problem, there = base.problem, np.zeros(len(base.problem.spread), dtype=bool)
    for index in base.free:
        there[problem.columns_of(index)] = True
    return problem.tolerant & (problem.spread > rules.HELD_FACTOR) & ~there


def _as_modelled(rig: Rig, base: Hypothesis) -> Hypothesis:
    """The same with residuals and slopes of the machine as it is modelled, in the noise that is left there."""
    problem = base.problem
    if not near(rig, base):
        return base
    fresh = Problem.of(rig.rows(problem.candidates), problem.candidates)
    fresh = replace(
        fresh, power=problem.power, spread=problem.spread, tolerant=problem.tolerant, odds=problem.odds
    )
    return Hypothesis.of(fresh, base.free, base.allowed)
