"""What is believed before the data are seen: odds of a cause at a place, and how far a kind scatters."""

import numpy as np

from discrepancy import rules
from discrepancy.candidate import Candidate
from discrepancy.least_squares.problem import Problem
from estimator.arrays import Array


def log_prior_odds(problem: Problem, candidate: Candidate) -> float:
    """Log of the odds that a candidate is there before the data are seen.

    Every cause is as likely as any other, at each of its places alike; an event also at each interval. The size of a
    fault is as likely in each of so many octaves.
    """
    if candidate.transient is not None:
        places = rules.INTERVALS
    elif candidate.among:
        places = candidate.among
    else:
        places = sum(
            other.cause == candidate.cause and other.transient is None for other in problem.candidates
        )
    return float(np.log(problem.odds / max(places, 1) / rules.SLAB_OCTAVES))


def far(spread: Array, near: Array | float) -> Array:
    """Twice the loss of a kind's log prior by its spread, per number of it, where it is expected ``near``."""
    return np.asarray(2.0 * np.log(spread / near) + (near / spread) ** 2 - 1.0)


def nearest(spread: Array, level: Array | float) -> Array:
    """What a kind's spread is held against: its tolerance or how far off all else is, whichever is more likely."""
    return np.asarray(np.where(far(spread, 1.0) > far(spread, level), level, 1.0))


def levels(spread: Array, told: Array) -> Array:
    """How far off a machine is as a whole, as every kind may be, too: the weighted median of the other kinds' spreads.

    One kind that scatters is news. Where nine of ten are ten times as far off as they should be, that the tenth is as
    well is none.

    Args:
        spread: of every kind with several places, over its tolerance, shape (kinds,).
        told: share of its numbers that the data determine, shape (kinds,).

    Returns:
        Shape (kinds,); at least 1, and 1 where fewer than ``rules.LEVEL_KINDS`` others are told.
    """
    if not len(spread):
        return spread
    order = np.argsort(spread)
    others = np.tile(told[order], (len(spread), 1))
    others[np.arange(len(spread)), order.argsort()] = 0.0
    passed = np.cumsum(others, axis=1)
    median = spread[order][np.argmax(passed >= 0.5 * passed[:, -1:], axis=1)]
    return np.where(passed[:, -1] >= rules.LEVEL_KINDS, np.maximum(median, 1.0), 1.0)
