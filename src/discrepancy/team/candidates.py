"""List every cause at every place and in every shape, and compute the residual that causes explain."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from discrepancy.candidate import Candidate
from discrepancy.team.causes import CAUSES
from discrepancy.team.causes.base import Shape
from discrepancy.team.linear.rows import Reduction
from discrepancy.team.linear.trial_linear import TrialLinear
from estimator.arm.unit import AT, ArmUnit
from estimator.arrays import Array

_GROUPS: dict[str, tuple[str, ...]] = {
    "phi_zero": ("phi_zero",),
    "theta_zero": ("theta_zero",),
    "link_length": ("proximal_length", "rod_length", "radius"),
    "sea_scale": ("stiffness_ratio",),
    "sea_bias": ("tau_zero",),
    "base_tilt": ("tilt",),
}
"""Groups of ``ArmUnit.x`` that hold a cause's parameters, in their order."""


def places_of(candidate: Candidate) -> tuple[int, NDArray[np.intp]] | None:
    """Row and columns of a candidate's parameters in ``ArmUnit.x`` of a team; None if they are not part of it."""
    groups = _GROUPS.get(candidate.cause)
    if groups is None or candidate.transient is not None:
        return None
    robot = (candidate.robot or 1) - 1
    if candidate.joint is None:
        return robot, np.arange(AT[groups[0]].start, AT[groups[0]].stop)
    return robot, np.array([AT[group].start + candidate.joint - 1 for group in groups])


def origin_of(candidate: Candidate, origin: ArmUnit | None) -> Array | None:
    """Values of a candidate's parameters at the linearisation point, shape (k,); None if all are zero.

    Args:
        candidate: of a team's catalogue.
        origin: linearisation point of the robots minus their assumed parameters, ``x`` of shape (N, COUNT).
    """
    place = places_of(candidate)
    return None if origin is None or place is None else np.asarray(origin.x[place], dtype=np.float64)


def beyond(candidate: Candidate, values: Array, origin: ArmUnit | None) -> Array:
    """Values of a candidate minus those that the linearisation point of the robots already includes."""
    there = origin_of(candidate, origin)
    return values if there is None else values - there


Tolerances = Mapping[str, float]


def every_candidate(
    robots: int, tolerances: Mapping[str, Tolerances], excluded: Collection[str]
) -> list[Candidate]:
    """List every cause of the catalogue at every place of N robots, except for transients.

    Args:
        robots: N.
        tolerances: standard deviations by cause and parameter.
        excluded: causes left out.
    """
    out = []
    for cause in CAUSES.values():
        if cause.name in excluded or cause.transient:
            continue
        joints = cause.joints if cause.per == "joint" else (None,)
        places = (None,) if cause.per == "payload" else range(1, robots + 1)
        given = tolerances.get(cause.name, {})
        out += [cause.candidate(given, cause.shapes[0], robot, joint) for robot in places for joint in joints]
    return out


def in_shapes(candidate: Candidate, shapes: Sequence[Shape], trials: int) -> list[Candidate]:
    """The candidate in each of some other shapes that the number of trials allows."""
    cause = CAUSES[candidate.cause]
    if candidate.transient:
        return [candidate.in_shape(shape) for shape in shapes]
    return [
        replace(candidate, shape=dict(shape), among=cause.alike(shape))
        for shape in shapes
        if dict(shape) != candidate.shape
        and max(shape.get("trial", 1), shape.get("last_trial", 0) + 1) <= trials
    ]


def shape_steps(candidate: Candidate) -> list[tuple[Candidate, Candidate, float]]:
    """Change each shape number that the data determine both ways; also return the total step."""
    steps = []
    cause = CAUSES[candidate.cause]
    for name in (name for name in cause.determined if name in candidate.shape):
        number = candidate.shape[name]
        step = cause.slope_step(name, number)
        ends = number - step, number + step
        if name == "ramp_s":  # the push would shrink with a longer ramp
            ends = ends[0], min(ends[1], 0.5 * candidate.shape["duration_s"])
        less, more = (candidate.in_shape({**candidate.shape, name: x}) for x in ends)
        steps.append((less, more, ends[1] - ends[0]))
    return steps


def explained_by(
    active: Sequence[tuple[Candidate, Array]], origin: ArmUnit
) -> Callable[[int, TrialLinear], Array] | None:
    """Make a function that returns the residual of every sample that causes explain, shape (Q, C); None without causes.

    Args:
        active: causes with their values, in their own units.
        origin: linearisation point of the robots minus their assumed parameters. Causes that are such parameters are
            not included.
    """
    others = [(c, beyond(c, values, origin)) for c, values in active if places_of(c) is None]
    if not others:
        return None

    def explained(trial: int, linear: TrialLinear) -> Array:
        every = replace(linear, reduction=Reduction.none(linear.signals.time))
        out = np.zeros((len(linear.s), linear.channels))
        for candidate, values in others:
            if candidate.acts_in(trial):
                out += CAUSES[candidate.cause].columns(every, *indices(candidate), candidate.shape) @ values
        return out

    return explained


def indices(candidate: Candidate) -> tuple[int, int]:
    """Robot and joint of a candidate, from 0 (0 if it has none)."""
    return (candidate.robot or 1) - 1, (candidate.joint or 1) - 1
