"""Where a fit finds a team's robots, and how far straight columns are off there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.least_squares.whitening import Whitening
from discrepancy.team.linear.origin import beyond, places_of
from discrepancy.team.linear.signals import Signals
from discrepancy.team.linear.start import exact_residual
from discrepancy.team.linear.trial_linear import TrialLinear
from estimator.arm.arms import true_joints
from estimator.arm.unit import COUNT, ArmUnit
from estimator.arrays import Array
from estimator.rigid_team.residual import Shared

HEALTHY = {"joint_friction": 1.0, "gimbal_friction": 1.0, "sea_hysteresis": 1.0, "grasp_play": 1.0}
"""Kinds that leave something open even where they are within their tolerances, and that spread."""


@dataclass(frozen=True, eq=False)
class Elsewhere:
    """Where a fit with tolerances finds a team.

    Attributes:
        units: the robots.
        origin: how far they are from where they were believed to be.
        shared: grasps and payload.
        curvature: mean square of what straight columns miss there, in units of the noise's variance.
    """

    units: ArmUnit
    origin: ArmUnit
    shared: Shared
    curvature: float


def found_at(
    linear: Sequence[TrialLinear],
    whitening: Sequence[Whitening],
    found: Hypothesis,
    origin: ArmUnit | None,
) -> Elsewhere:
    """Where a fit finds the robots, with the causes that are in it or without any.

    Args:
        linear, whitening: of every trial.
        found: the fit; its values are counted from where the robots were believed to be.
        origin: how far from there the trials are linear.
    """
    problem, fit, own = found.problem, found.fit, linear[0].by_bases.shape[2]
    at = linear[0].arms.x if isinstance(linear[0].arms, ArmUnit) else np.zeros((linear[0].robots, COUNT))
    step, moved = np.zeros_like(at), []
    for index, candidate in enumerate(problem.candidates):
        place = places_of(candidate)
        if place is not None:
            step[place] = beyond(candidate, fit.part(index)[0] * candidate.units, origin)
            moved.append(index)
    units, shared = ArmUnit(linear[0].design, at + step), linear[0].shared.moved(-fit.shared)
    square = [
        np.mean(
            (white(_exact(trial, units, shared, fit.local(t)[:own])) - _straight(found, t, own, moved)) ** 2
        )
        for t, (trial, white) in enumerate(zip(linear, whitening, strict=True))
    ]
    before = np.zeros_like(step) if origin is None else origin.x
    return Elsewhere(units, ArmUnit(units.design, before + step), shared, float(np.mean(square)))


def _exact(trial: TrialLinear, units: ArmUnit, shared: Shared, local: Array) -> Array:
    """Rows of a trial with other robots and unknowns, shape (n, C)."""
    s = trial.signals
    signals = Signals(s.time, *true_joints(units, *as_read(trial)), s.rate_hz, s.sampling)
    return exact_residual(signals, shared, trial.bases.moved(-local), units, trial.reduction)


def as_read(trial: TrialLinear) -> tuple[Array, Array, Array]:
    """phi, theta, tau as the sensors read them, shape (Q, N, 3) each."""
    s = trial.signals
    if not isinstance(trial.arms, ArmUnit):
        return s.phi, s.theta, s.tau
    arms = trial.arms
    tau = s.tau / (1.0 + arms.of("stiffness_ratio")) + arms.of("tau_zero")
    return s.phi + arms.of("phi_zero"), s.theta + arms.of("theta_zero"), tau


def _straight(found: Hypothesis, t: int, own: int, moved: Sequence[int]) -> Array:
    """What straight columns say of the same rows, shape (n, C)."""
    problem, fit = found.problem, found.fit
    values = np.append(np.zeros(problem.width - 1), 1.0)
    values[: problem.shared] = -fit.shared
    for index in moved:
        values[problem.spans[index]] = -fit.part(index)[0]
    return problem.raw_times(t, values) - problem.local[t][..., :own] @ fit.local(t)[:own]


def resting_of(found: Hypothesis) -> dict[str, float]:
    """Spread over its tolerance, at least 1, of each kind that leaves something open: noise of that size."""
    sizes: dict[str, list[float]] = {kind: [] for kind in HEALTHY}
    for index, candidate in enumerate(found.problem.candidates):
        if candidate.cause in sizes and found.problem.has_tolerance(index):
            sizes[candidate.cause].append(abs(float(found.fit.part(index)[0][0])))
    # By the median, as one of them may be at fault; 0.67 is that of a normal one.
    return {kind: max(1.0, float(np.median(x)) / 0.6745) if x else 1.0 for kind, x in sizes.items()}
