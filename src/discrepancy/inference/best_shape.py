"""The numbers of a cause's shape that the data determine: their best values, their standard errors."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from discrepancy.candidate import Candidate
from discrepancy.least_squares.fit import Fit
from discrepancy.rig import Rig
from estimator.arrays import Array


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
        shape[name] += float(np.clip(step, -difference / 2, difference / 2))
    return replace(candidate, shape=shape)


def _with_slopes(rig: Rig, candidate: Candidate, values: Array) -> Sequence[Array]:
    """Columns of a candidate, and their change by every number of its shape, (n, C, k + s) per trial."""
    parts = [rig.columns(candidate)]
    for less, more, difference in rig.steps(candidate):
        ends = zip(rig.columns(less), rig.columns(more), strict=True)
        parts.append([((b - a) @ values / difference)[..., None] for a, b in ends])
    return [np.concatenate(trial, axis=2) for trial in zip(*parts, strict=True)]
