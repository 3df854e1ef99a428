"""Every cause at every place, and in every shape."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from discrepancy.rig import Candidate, Parameter, Transient
from discrepancy.team.causes import CAUSES
from discrepancy.team.causes.base import Cause
from discrepancy.team.linear.reduction import Reduction
from discrepancy.team.pushes import intervals_near, push, worst_intervals
from discrepancy.team.tolerances import DEFAULTS

Array = NDArray[np.float64]
Tolerances = Mapping[str, float]


def every_candidate(
    robots: int, tolerances: Mapping[str, Tolerances], excluded: Collection[str]
) -> list[Candidate]:
    """Every cause of the catalogue at every place of N robots, but for transients.

    Args:
        robots: N.
        tolerances: standard deviations by cause and parameter.
        excluded: causes left out.
    """
    out = []
    for cause in CAUSES.values():
        if cause.name in excluded or cause.name == "push":
            continue
        joints = cause.joints if cause.per == "joint" else (None,)
        places = (None,) if cause.per == "payload" else range(1, robots + 1)
        out += [
            _candidate(cause, tolerances.get(cause.name, {}), robot, joint)
            for robot in places
            for joint in joints
        ]
    return out


def _candidate(cause: Cause, given: Tolerances, robot: int | None, joint: int | None) -> Candidate:
    scales = cause.scales or tuple(given.get(name) or DEFAULTS[cause.name][name] for name in cause.parameters)
    parameters = tuple(
        Parameter(name, given.get(name, 0.0), scale)
        for name, scale in zip(cause.parameters, scales, strict=True)
    )
    return Candidate(cause.name, cause.family, robot, joint, parameters, dict(cause.shapes[0]))


def other_shapes(candidate: Candidate, *, finer: bool) -> list[Candidate]:
    """The candidate in every other shape of its cause, or in ``finer`` ones around its own."""
    cause = CAUSES[candidate.cause]
    shapes = cause.finer(candidate.shape) if finer else cause.shapes
    return [replace(candidate, shape=dict(shape)) for shape in shapes if dict(shape) != candidate.shape]


def shape_steps(candidate: Candidate) -> list[tuple[Candidate, Candidate, float]]:
    """The candidate with each number of its shape that the data determine changed both ways, and by how much."""
    steps = []
    for name, share in CAUSES[candidate.cause].determined.items():
        number = candidate.shape[name]
        less, more = (
            replace(candidate, shape={**candidate.shape, name: x * number}) for x in (1 - share, 1 + share)
        )
        steps.append((less, more, 2.0 * share * number))
    return steps


def nearby_pushes(at: Transient, tolerance: Tolerances) -> list[Candidate]:
    """Pushes with their interval moved."""
    return [
        push(at.trial, start, duration, tolerance)
        for start, duration in intervals_near(at.start_s, at.duration_s)
    ]


def worst_pushes(
    reductions: Sequence[Reduction], remaining: Sequence[Array], tolerance: Tolerances
) -> list[Candidate]:
    """Pushes at the intervals of every trial where the wrench balance is worst.

    Args:
        reductions: of every trial.
        remaining: whitened residual of every trial, shape (n, C); its last six channels are the wrench balance.
        tolerance: of a push.
    """
    out = []
    for t, (reduction, z) in enumerate(zip(reductions, remaining, strict=True)):
        moving = reduction.moving
        found = worst_intervals(reduction.time[:moving], np.sum(z[:moving, -6:] ** 2, axis=1))
        out += [push(t, start, duration, tolerance) for start, duration in found]
    return out
