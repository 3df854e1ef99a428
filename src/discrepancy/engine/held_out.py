"""Does a cause help where it was not fitted? Trials left out, blocks of a transient left out."""

from collections.abc import Sequence

import numpy as np

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
    trials = range(len(problem.rows))
    if len(problem.rows) < 2:
        return []
    gains = []
    for t in trials:
        values, _ = Fit.of(problem, [*free, index], [k for k in trials if k != t]).part(index)
        tolerated = Fit.of(problem, free, [t])
        gains.append(tolerated.misfit - Fit.of(problem, free, [t], fixed=(index, values)).misfit)
    return gains


def shares(problem: Problem, free: Sequence[int], index: int) -> tuple[float, float | None]:
    """Share of the nominal model's misfit that a cause removes, in sample and on trials left out of the fit.

    Nominal is the model with the causes before it and nothing else off; the room for improvement ends where the
    cause and every tolerance together leave the data.
    """
    after = [*free, index]
    full = Fit.of(problem, after)
    nominal, with_it = (Fit.of(problem, chosen, background=False) for chosen in (free, after))
    trials = range(len(problem.rows))
    floor = sum(full.held_out(t) for t in trials)
    in_sample = (nominal.misfit - with_it.misfit) / max(nominal.misfit - floor, 1e-9)
    if len(trials) < 2 or problem.candidates[index].transient:
        return float(np.clip(in_sample, 0.0, 1.0)), None
    gained, room = 0.0, 0.0
    for t in trials:
        others = [k for k in trials if k != t]
        before, after_it, best = (
            Fit.of(problem, free, others, background=False).held_out(t),
            Fit.of(problem, after, others, background=False).held_out(t),
            Fit.of(problem, after, others).held_out(t),
        )
        gained, room = gained + before - after_it, room + before - best
    return float(np.clip(in_sample, 0.0, 1.0)), float(np.clip(gained / max(room, 1e-9), 0.0, 1.0))


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
