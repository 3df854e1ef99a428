"""What these recordings could have shown: the smallest size of every cause that would have been noticed."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from discrepancy import rules
from discrepancy.engine.explanation import Explanation
from discrepancy.engine.scan import log_bayes_factor
from discrepancy.result.evidence_list import needed_nats
from discrepancy.rig import Candidate
from estimator.arrays import Array

OCTAVES, HALVINGS = 60, 8
"""Doublings in which a limit is sought, and halvings of the last: to 0.3 %."""


def detection_limits(explanation: Explanation) -> list[dict[str, Any]]:
    """Detection limit of every parameter at every place: {cause, kind, robot, joint, parameters: {name: size}}.

    A size is None where the data say nothing about it. Causes that are found, and transients, are left out.
    """
    return [entry for _, entry in _judged(explanation)]


def blind_spots(explanation: Explanation) -> list[dict[str, Any]]:
    """Causes and places about which these recordings say nothing at all, in the form of ``Rig.undecidable``."""
    places: dict[str, list[str]] = {}
    for candidate, entry in _judged(explanation):
        if all(size is None for size in entry["parameters"].values()):
            places.setdefault(candidate.kind, []).append(candidate.place)
    return [
        {
            "what": f"{cause} ({'; '.join(where)})",
            "why": "its trace in these recordings cannot be told from the unknowns",
            "remedy": "motion in more directions, where any helps",
        }
        for cause, where in places.items()
    ]


def _judged(explanation: Explanation) -> Iterator[tuple[Candidate, dict[str, Any]]]:
    fit, problem = explanation.fit, explanation.problem
    for index, candidate in enumerate(problem.candidates):
        if index in fit.free or candidate.transient:
            continue
        spread = float(problem.spread[problem.columns_of(index)][0]) if problem.has_tolerance(index) else 0.0
        needed = needed_nats(problem, candidate)
        sizes = noticed(fit.told(index)[0], spread, needed)
        parameters = {
            p.name: float(size * p.unit) if size < rules.ABSURD_UNITS else None
            for p, size in zip(candidate.parameters, sizes, strict=True)
        }
        place = dict(zip(("cause", "robot", "joint"), candidate.key, strict=True))
        yield candidate, {"kind": candidate.kind, **place, "parameters": parameters}


def noticed(information: Array, spread: float, needed: float) -> Array:
    """Size of every parameter, each alone, whose log Bayes factor reaches ``needed`` nine times in ten.

    Args:
        information: about the parameters given all else, in units, shape (k, k).
        spread: of healthy ones, in units.
        needed: nats.

    Returns:
        Sizes in units, shape (k,); infinite where no size does.
    """
    out = np.full(len(information), np.inf)
    for k, column in enumerate(information.T):
        if column[k] < rules.LEAST_INFORMATION:
            continue
        short = rules.NOTICED_SE / np.sqrt(column[k])  # noise takes as much away one time in ten

        def reached(size: float, column: Array = column) -> bool:
            return log_bayes_factor(information, column * size, spread) >= needed

        low, high = 0.0, 2.0**-20
        for _ in range(OCTAVES):
            if reached(high):
                break
            low, high = high, 2.0 * high
        else:
            continue
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            low, high = (low, middle) if reached(middle) else (middle, high)
        out[k] = high + short
    return out
