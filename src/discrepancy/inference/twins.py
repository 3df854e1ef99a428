"""Kinds that leave the same trace, such as a late torque log and a lag of its sensors: straight columns are one."""

import numpy as np

from discrepancy import rules
from discrepancy.least_squares.problem import Problem


def alike(problem: Problem, one: str, other: str) -> bool:
    """Whether two kinds of one parameter have the same columns at all places, but for their size."""
    a, b = _columns(problem, one), _columns(problem, other)
    if len(a) != len(b):
        return False
    own, across, others = (
        sum(grams[:, x, y].sum(axis=0) for grams in problem.cell_grams) for x, y in ((a, a), (a, b), (b, b))
    )
    return bool(np.all(across**2 >= (1.0 - rules.SAME_TRACE) * own * others))


def _columns(problem: Problem, kind: str) -> list[int]:
    """First columns of all candidates of a kind; none where one has several."""
    at = [
        problem.spans[i]
        for i, candidate in enumerate(problem.candidates)
        if candidate.cause == kind and problem.has_tolerance(i)
    ]
    return [] if any(span.stop - span.start > 1 for span in at) else [span.start for span in at]
