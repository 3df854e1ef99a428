"""Is it a transient, or one sensor that was wrong for as long?"""

from collections.abc import Sequence

import numpy as np

from discrepancy.engine.leaders import Leader, price
from discrepancy.least_squares.fit import Fit
from discrepancy.rig import Rig


def imitated(rig: Rig, leader: Leader, free: Sequence[int]) -> bool:
    """Whether an error of a single sensor tells as much as a transient, its fewer numbers counted.

    A lasting cause that shows at rare loads only, such as the hardening of one spring, looks like a push at that
    time; but then its torque alone accounts for it, and a push has six numbers for the same.
    """
    candidate, problem = leader.candidate, leader.problem
    if not candidate.transient:
        return False
    without = Fit.of(problem, free, fixed=(leader.evidence.index, np.zeros(len(candidate.parameters))))
    each = price(problem)
    own = without.fall_with(rig.columns(candidate)) - each * len(candidate.parameters)
    others = (without.fall_with(columns) - each * columns[0].shape[2] for columns in rig.imitators(candidate))
    return any(other > own for other in others)
