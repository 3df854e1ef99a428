"""Kinds that leave the same trace, such as a late torque log and a lag of its sensors: straight columns are one."""

from collections.abc import Iterable

import numpy as np

from discrepancy import rules
from discrepancy.least_squares.problem import Problem


def twins(problem: Problem, kinds: Iterable[str]) -> list[tuple[str, str]]:
    """Pairs of kinds, of one parameter each, with the same columns at all places but for their size."""
    places: dict[int, list[tuple[str, list[int]]]] = {}
    for kind in kinds:
        spans = [
            problem.spans[i]
            for i, candidate in enumerate(problem.candidates)
            if candidate.cause == kind and problem.has_tolerance(i)
        ]
        if all(span.stop - span.start == 1 for span in spans):
            places.setdefault(len(spans), []).append((kind, [span.start for span in spans]))
    found = []
    for each in places.values():
        at = np.array([columns for _, columns in each])  # (kinds, places)
        gram = np.sum([grams.summed(at[:, None], at) for grams in problem.cell_grams], axis=0)
        own = np.einsum("aap->ap", gram)
        same = np.all(gram**2 >= (1.0 - rules.SAME_TRACE) * own[:, None] * own, axis=-1)
        found += [(each[a][0], each[b][0]) for a, b in np.argwhere(np.triu(same, 1))]
    return found
