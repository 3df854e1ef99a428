"""What is believed before the data are seen: odds of a cause at a place, and how far a kind scatters."""

from __future__ import annotations

from dataclasses import dataclass

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
        places = rules.INTERVALS * (rules.RAMPS if candidate.transient.ramp_s else 1.0)
    elif candidate.among:
        places = candidate.among
    else:
        places = sum(
            other.cause == candidate.cause and other.transient is None for other in problem.candidates
        )
    return float(np.log(problem.odds / max(places, 1) / rules.SLAB_OCTAVES))


@dataclass(frozen=True, eq=False)
class Level:
    """What the spreads of kinds are held against besides their tolerances: how far off the others are.

    One kind that scatters is news. Where nine of ten are ten times as far off as they should be, that the tenth is as
    well is none; and the more of them say so, the farther one has to stand out of it.

    Attributes:
        spread: over the tolerance, at least 1, shape (kinds,).
        numbers: that it counts for when a kind's spread is learnt, shape (kinds,).
    """

    spread: Array
    numbers: Array

    @classmethod
    def of(cls, spread: Array, told: Array) -> Level:
        """The weighted median of the other kinds' spreads.

        Args:
            spread: of every kind with several places, over its tolerance, shape (kinds,).
            told: share of its numbers that the data determine, shape (kinds,).

        Returns:
            1 where fewer than ``rules.LEVEL_KINDS`` others are told. Each that is counts as one more number.
        """
        if not len(spread):
            return cls(spread, spread)
        order = np.argsort(spread)
        others = np.tile(told[order], (len(spread), 1))
        others[np.arange(len(spread)), order.argsort()] = 0.0
        passed = np.cumsum(others, axis=1)
        kinds = passed[:, -1]
        median = spread[order][np.argmax(passed >= 0.5 * passed[:, -1:], axis=1)]
        many = kinds >= rules.LEVEL_KINDS
        return cls(np.where(many, np.maximum(median, 1.0), 1.0), rules.SPREAD_NUMBERS + kinds)

    def prior(self, spread: Array) -> tuple[Array, Array, Array]:
        """Loss of the log prior by some spreads, what they are held against, and numbers that counts for.

        Their tolerance or the level, whichever is likelier.
        """
        tolerance = _loss(spread, 1.0, rules.SPREAD_NUMBERS)
        level = _loss(spread, self.spread, self.numbers)
        near = level < tolerance
        return (
            np.where(near, level, tolerance),
            np.where(near, self.spread, 1.0),
            np.where(near, self.numbers, rules.SPREAD_NUMBERS),
        )


def _loss(spread: Array, near: Array | float, numbers: Array | float) -> Array:
    """By which a log prior is lower than where it is expected, ``near``, which counts for so many numbers."""
    return np.asarray(0.5 * numbers * (2.0 * np.log(spread / near) + (near / spread) ** 2 - 1.0))
