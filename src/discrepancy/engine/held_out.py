"""Does a cause, or what all places are off by, help where it was not fitted? Trials left out."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from discrepancy.inference.scan import likeliest_spread, log_evidence
from discrepancy.least_squares.fit import Fit
from discrepancy.least_squares.problem import Problem
from estimator.arrays import Array


def held_out_gains(problem: Problem, free: Sequence[int], index: int) -> list[float]:
    """By how much the other trials' fit predicts every trial better with a cause in it than without: of chi-square.

    What is there in some trials only says nothing of the others: it has none.
    """
    if problem.candidates[index].of_trials or len(problem.trials) < 2:
        return []
    gains, nothing = [], np.zeros(len(problem.candidates[index].parameters))
    for t in problem.trials:
        others = [k for k in problem.trials if k != t]
        # Not within its tolerance: the spread of what is there is its size.
        told = _told(problem, free, t)
        without = Fit.of(problem, told, others, fixed=(index, nothing))
        gains.append(without.held_out(t) - Fit.of(problem, [*told, index], others).held_out(t))
    return gains


def predictive_nats(problem: Problem, free: Sequence[int], index: int) -> list[float]:
    """By how many nats every trial is likelier with a cause than without, as the other trials foretell it.

    Of its values no more is known than they tell: log p(trial | others) with it, less that without. Of what is there,
    that is below -a with a probability of exp(-a) at most. What is there in some trials only has none.
    """
    if problem.candidates[index].of_trials or len(problem.trials) < 2:
        return []
    spread = likeliest_spread(*_told_alone(problem, free, index, problem.trials))
    gains = []
    for t in problem.trials:
        told = _told(problem, free, t)
        others = [k for k in problem.trials if k != t]
        known, foretelling = (
            log_evidence(*_told_alone(problem, told, index, trials), spread)
            for trials in (problem.trials, others)
        )
        gains.append(known - foretelling)
    return gains


def _told_alone(
    problem: Problem, free: Sequence[int], index: int, trials: Sequence[int]
) -> tuple[Array, Array]:
    """Information about a cause and its score vector, given all else, of some trials."""
    fit = Fit.of(problem, free, trials, fixed=(index, np.zeros(len(problem.candidates[index].parameters))))
    return fit.told_besides(index)


@dataclass(frozen=True)
class Foretold:
    """How well every trial is foretold by the others; its own unknowns, such as where bases stand, come from itself.

    Attributes:
        as_designed: chi-square per row with the causes alone, everything else as designed.
        as_found: with everything as far off as the other trials find it.
    """

    as_designed: float
    as_found: float


def foretold(problem: Problem, free: Sequence[int]) -> Foretold | None:
    """What it is worth to know the machine as it is, on trials that it was not learnt from; None for a single one.

    Spreads are of all trials, a number for each kind; what is off at each place is of the others.
    """
    if len(problem.trials) < 2:
        return None
    left = np.zeros(2)
    for t in problem.trials:
        others, told = [k for k in problem.trials if k != t], _told(problem, free, t)
        left += [Fit.of(problem, told, others, background=off).held_out(t) for off in (False, True)]
    return Foretold(*map(float, left / problem.samples))


def _told(problem: Problem, free: Sequence[int], trial: int) -> list[int]:
    """The causes without the events of a trial: of those the other trials tell nothing."""
    candidates = problem.candidates
    return [i for i in free if candidates[i].transient is None or not candidates[i].acts_in(trial)]


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
        left += [
            Fit.of(problem, _told(problem, step, t), others, background=False).held_out(t) for step in steps
        ]
        best += Fit.of(problem, _told(problem, causes, t), others).held_out(t)
    # What acts in one trial only cannot be fitted to the others.
    lasting = [not problem.candidates[index].of_trials for index in causes]
    return [
        (share, held_out if lasts else None)
        for share, held_out, lasts in zip(in_sample, _parts(left, best), lasting, strict=True)
    ]


def _parts(left: ArrayLike, floor: float) -> list[float]:
    """How much every step takes of what there is above a floor at first; a step that takes nothing has no share."""
    left = np.minimum.accumulate(np.asarray(left))
    room = max(left[0] - min(floor, left[-1]), 1e-9)
    return [float(part) for part in np.clip(-np.diff(left) / room, 0.0, 1.0)]
