"""What these recordings could have shown: the smallest size of every cause that would have been noticed."""

from __future__ import annotations

from typing import Any

import numpy as np

from discrepancy.explanation import Explanation

NOTICED = 38.0
"""Expected gain of chi-square at which a cause is found in about nine of ten data sets."""
ABSURD = 1e3
"""A limit of so many tolerances (or typical sizes) is none."""


def detection_limits(explanation: Explanation) -> list[dict[str, Any]]:
    """Detection limit of every parameter at every place; None where the data say nothing about it."""
    limits = explanation.fit.limits(NOTICED)
    out = []
    for index, (candidate, sizes) in enumerate(zip(explanation.problem.candidates, limits, strict=True)):
        if index in explanation.fit.free or candidate.detail:
            continue
        out.append(
            {
                "cause": candidate.cause,
                "robot": candidate.robot,
                "joint": candidate.joint,
                "parameters": {
                    p.name: float(size) if size < ABSURD * p.unit else None
                    for p, size in zip(candidate.parameters, np.asarray(sizes), strict=True)
                },
            }
        )
    return out


def blind_spots(explanation: Explanation) -> list[dict[str, Any]]:
    """Causes and places about which these recordings say nothing at all."""
    return [
        {
            "what": f"{entry['cause']} (robot {entry['robot']}, joint {entry['joint']})"
            if entry["joint"]
            else f"{entry['cause']} ({'robot ' + str(entry['robot']) if entry['robot'] else 'payload'})",
            "why": "its trace in these recordings cannot be told from the unknowns",
            "remedy": "more motion, in more directions",
        }
        for entry in detection_limits(explanation)
        if all(size is None for size in entry["parameters"].values())
    ]
