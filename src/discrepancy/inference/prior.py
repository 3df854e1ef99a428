"""Prior odds of a cause at a place."""

import numpy as np

from discrepancy import rules
from discrepancy.candidate import Candidate
from discrepancy.least_squares.problem import Problem


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
