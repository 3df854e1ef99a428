"""What these recordings could have shown: the smallest size of every cause that would have been noticed."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from discrepancy import rules
from discrepancy.engine.explanation import Explanation
from discrepancy.rig import Candidate


def detection_limits(explanation: Explanation) -> list[dict[str, Any]]:
    """Detection limit of every parameter at every place: {cause, kind, robot, joint, parameters: {name: size}}.

    A size is None where the data say nothing about it. Causes that are named, and transients, are left out.
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
    limits = explanation.fit.limits(rules.NOTICED_CHI2)
    for index, (candidate, sizes) in enumerate(zip(explanation.problem.candidates, limits, strict=True)):
        if index in explanation.fit.free or candidate.transient:
            continue
        parameters = {
            p.name: float(size) if size < rules.ABSURD_UNITS * p.unit else None
            for p, size in zip(candidate.parameters, np.asarray(sizes), strict=True)
        }
        place = dict(zip(("cause", "robot", "joint"), candidate.key, strict=True))
        yield candidate, {"kind": candidate.kind, **place, "parameters": parameters}
