"""Does a cause help where it was not fitted? Trials left out, blocks of a transient left out."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from discrepancy import rules
from discrepancy.least_squares.fit import Fit
from discrepancy.least_squares.problem import Problem


def confirmed(folds: Sequence[float]) -> bool:
    """Whether the gains on what was left out speak for a cause; nothing left out says nothing against it."""
    if len(folds) < 2:
        return True
    helped, harmed = sum(g for g in folds if g > 0), -sum(g for g in folds if g < 0)
    supporting = sum(gain > 0 for gain in folds)
    return supporting >= rules.SUPPORTING_TRIALS and harmed <= rules.AGAINST_SHARE * helped


def held_out_gains(problem: Problem, free: Sequence[int], index: int) -> list[float]:
    """How much rather every trial has a cause as the other trials fitted it than all within its tolerance."""
    transient = problem.candidates[index].transient
    if transient:
        return _interleaved(problem, free, index, transient.trial)
    trials = problem.trials
    if len(problem.raw) < 2:
        return []
    gains = []
    for t in trials:
        values, _ = Fit.of(problem, [*free, index], [k for k in trials if k != t]).part(index)
        tolerated = Fit.of(problem, free, [t])
        gains.append(tolerated.misfit - Fit.of(problem, free, [t], fixed=(index, values)).misfit)
    return gains


def shares(problem: Problem, causes: Sequence[int]) -> list[tuple[float, float | None]]:
    """What every cause removes beyond those before it: in sample, and on trials left out of the fit.

    Both are shares of the misfit of the nominal model, in which nothing is off, so they add up to what all causes
    remove together. The room for improvement ends where the causes and every tolerance together leave the data.
    """
    trials, steps = problem.trials, [list(causes[:k]) for k in range(len(causes) + 1)]
    full = Fit.of(problem, causes)
    floor = sum(full.held_out(t) for t in trials)
    in_sample = _parts([Fit.of(problem, step, background=False).misfit for step in steps], floor)
    if len(trials) < 2:
        return [(share, None) for share in in_sample]
    left, best = np.zeros(len(steps)), 0.0
    for t in trials:
        others = [k for k in trials if k != t]
        left += [Fit.of(problem, step, others, background=False).held_out(t) for step in steps]
        best += Fit.of(problem, causes, others).held_out(t)
    # What acts in one trial only cannot be fitted to the others.
    lasting = [problem.candidates[index].transient is None for index in causes]
    return [
        (share, held_out if lasts else None)
        for share, held_out, lasts in zip(in_sample, _parts(left, best), lasting, strict=True)
    ]


def _parts(left: ArrayLike, floor: float) -> list[float]:
    """How much every step takes of what there is above a floor at first; a step that takes nothing has no share."""
    left = np.minimum.accumulate(np.asarray(left))
    room = max(left[0] - min(floor, left[-1]), 1e-9)
    return [float(part) for part in np.clip(-np.diff(left) / room, 0.0, 1.0)]


def _interleaved(
    problem: Problem, free: Sequence[int], index: int, trial: int, blocks: int = rules.INTERLEAVED_BLOCKS
) -> list[float]:
    """The same within the trial of a transient, against none at all: fitted to all but every fourth block of it."""
    rows = problem.rows[trial]
    size = np.abs(rows[..., problem.spans[index]]).sum(axis=(1, 2))
    inside = np.flatnonzero(size > rules.INSIDE_SHARE * size.max())
    if len(inside) < rules.SHORT_ROWS:
        return []
    width = max(1, len(inside) // (2 * blocks))
    gains = []
    for b in range(blocks):
        out = np.zeros(len(rows), dtype=bool)
        out[inside[(np.arange(len(inside)) // width) % blocks == b]] = True
        apart = np.einsum("nck,ncl->kl", rows[out], rows[out], optimize=True)
        gram = problem.grams.sum(axis=0) - apart
        without = Fit.of_gram(problem, gram, free, held=(index,))
        with_it = Fit.of_gram(problem, gram, [*free, index])
        gains.append(without.chi2_of(apart) - with_it.chi2_of(apart))
    return gains
