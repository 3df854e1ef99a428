"""Is it what it seems, or something simpler, such as one sensor that was wrong for as long?"""

from collections.abc import Sequence

import numpy as np

from discrepancy.engine.leaders import Leader, price
from discrepancy.least_squares.fit import Fit
from discrepancy.rig import Rig


def imitated(rig: Rig, leader: Leader, free: Sequence[int]) -> bool:
    """Whether one of a rig's imitators tells more than the candidate, their numbers counted.

    A lasting cause that shows at rare loads only, such as the hardening of one spring, looks like a push at that
    time; but then its torque alone accounts for it, and a push has six numbers for the same. Friction where an axis
    turns round looks like pulses of force that come about as often; but then pulses in step with the motion tell more.
    """
    candidate, problem = leader.candidate, leader.problem
    without = Fit.of(problem, free, fixed=(leader.evidence.index, np.zeros(len(candidate.parameters))))
    each = price(problem)
    own = without.fall_with(rig.columns(candidate)) - each * len(candidate.parameters)
    others = (without.fall_with(columns) - each * columns[0].shape[2] for columns in rig.imitators(candidate))
    return any(other > own for other in others)
