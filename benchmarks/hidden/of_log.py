"""Detection limits of given recordings."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from discrepancy.least_squares.fit import Fit
from discrepancy.least_squares.problem import Problem
from discrepancy.team.rig import TeamRig
from discrepancy.team.tolerances import default_tolerances, read_tolerances
from estimator.estimate.payload import estimate_payload
from estimator.recording.model import Recording
from hidden.limits import LIMITS
from hidden.sizes import sizes_of
from mocobot.campaign.limits import GAIN, pushes

Place = tuple[str, int | None, int | None, int | None]
"""Cause, robot, joint and trial (from 1), where it has them."""


def limits_of(recordings: Sequence[Recording]) -> dict[Place, float]:
    """Detection limits over those of ``hidden.limits``, by place: the median over parameters and a trial's instants."""
    rig = TeamRig.of(recordings, estimate_payload(recordings), read_tolerances(None))
    candidates = [*rig.candidates(), *pushes(rig, default_tolerances()["push"])]
    problem = Problem.of(rig.rows(candidates), candidates)
    found: dict[Place, list[float]] = {}
    for candidate, values in zip(candidates, sizes_of(Fit.of(problem), GAIN), strict=True):
        known, at = LIMITS[candidate.cause], candidate.transient
        trial = None if at is None else at.trial + 1
        ratios = [
            v / known[p.name] for p, v in zip(candidate.parameters, values, strict=True) if p.name in known
        ]
        found.setdefault((candidate.cause, candidate.robot, candidate.joint, trial), []).extend(ratios)
    return {place: float(np.median(ratios)) for place, ratios in found.items()}
