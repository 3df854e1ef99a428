"""Is it a transient, or one sensor that was wrong for as long?"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from discrepancy import rules
from discrepancy.engine.leaders import Leader
from discrepancy.rig import Rig


def imitated(rig: Rig, leader: Leader, free: Sequence[int]) -> bool:
    """Whether an error of a single sensor tells as much as a transient, its fewer numbers counted.

    A lasting cause that shows at rare loads only, such as the hardening of one spring, looks like a push at that
    time; but then its torque alone accounts for it, and a push has six numbers for the same.
    """
    candidate, problem = leader.candidate, leader.problem
    if not candidate.transient:
        return False
    without = problem.fit(free, fixed=(leader.evidence.index, np.zeros(len(candidate.parameters))))
    price = rules.COMPLEXITY * np.log(problem.samples)
    own = without.fall_with(rig.columns(candidate)) - price * len(candidate.parameters)
    others = (
        without.fall_with(columns) - price * columns[0].shape[2] for columns in rig.imitators(candidate)
    )
    return any(other > own for other in others)
