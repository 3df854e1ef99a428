"""The unknowns before any cause: from the estimate, then Gauss-Newton on the whitened residual."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from discrepancy import rules
from discrepancy.least_squares.whitening import Whitening
from discrepancy.team.linear.adjust import TorqueNoise
from discrepancy.team.linear.noise import Noise
from discrepancy.team.linear.reduction import Reduction
from discrepancy.team.linear.residual import Bases, Shared, balance, grasp_data, pose_residual
from discrepancy.team.linear.signals import Signals, with_rates
from discrepancy.team.linear.trial_linear import TrialLinear, linearise, noise_rows
from estimator.arm.design import OmnidDesign
from estimator.errors import InputError
from estimator.estimate.principal import inertia_parameters
from estimator.estimate.result import PayloadEstimate

Array = NDArray[np.float64]


def start_shared(estimate: PayloadEstimate) -> Shared:
    """Unknowns from the estimate.

    Raises:
        InputError: grasps, mass or centre of mass are missing.
    """
    grasps, mass, c = estimate.grasps, estimate.mass, estimate.p_1c
    missing = [
        name
        for name, value in (
            ("grasps", estimate.grasps),
            ("mass", estimate.mass),
            ("centre of mass", estimate.p_1c),
        )
        if value is None
    ]
    if missing or grasps is None or mass is None or c is None:
        raise InputError(
            f"these recordings do not determine the {missing[0]}, so there is nothing to hold the data against; "
            "add a recording with motion in all axes"
        )
    inertia = estimate.inertia.inertia if estimate.inertia else np.zeros((3, 3))
    about_1 = inertia + mass.mass * (c @ c * np.eye(3) - np.outer(c, c))
    return Shared(grasps, np.concatenate([[mass.mass], mass.mass * c, inertia_parameters(about_1)]))


def linearised(
    signals: Signals,
    shared: Shared,
    bases: Bases,
    design: OmnidDesign,
    reduction: Reduction,
    noise: Noise,
    k: int,
) -> tuple[TrialLinear, Whitening, TorqueNoise]:
    """One trial's linearisation, and what the sensors' noise leaves in its rows; k is its number."""
    linear = linearise(signals, shared, bases, design, reduction, full=True)
    draws, torques = noise_rows(linear, noise, np.random.default_rng([rules.NOISE_SEED, k]))
    moving = reduction.moving
    return linear, Whitening.of(draws, moving), TorqueNoise.of(draws, torques, moving)


def exact_residual(
    signals: Signals, shared: Shared, bases: Bases, design: OmnidDesign, reduction: Reduction
) -> Array:
    rate = signals.rate_hz
    Q, N = signals.phi.shape[:2]
    parts = with_rates(signals.phi, rate), with_rates(signals.theta, rate), with_rates(signals.tau, rate)[:1]
    s = np.concatenate(parts).transpose(1, 2, 0, 3).reshape(Q, N, -1)
    force = balance(grasp_data(s, design, rate), shared)[0]
    pose = pose_residual(signals.phi, signals.theta, shared, bases, design)
    return reduction(np.concatenate([pose, force], axis=1))


def gauss_newton(linear: Sequence[TrialLinear], whitening: Sequence[Whitening]) -> tuple[Shared, list[Bases]]:
    """One step of all unknowns, with no cause in the model."""
    own = linear[0].by_bases.shape[2]
    shared_columns = linear[0].by_shared.shape[2]
    total = shared_columns + own * len(linear)
    gram, right = np.zeros((total, total)), np.zeros(total)
    for t, (trial, white) in enumerate(zip(linear, whitening, strict=True)):
        at = np.r_[np.arange(shared_columns), shared_columns + own * t + np.arange(own)]
        columns = np.concatenate([white(trial.by_shared), white(trial.by_bases)], axis=2)
        columns = columns.reshape(-1, columns.shape[2])
        gram[np.ix_(at, at)] += columns.T @ columns
        right[at] += columns.T @ white(trial.residual).ravel()
    scale = 1.0 / np.sqrt(np.maximum(np.diag(gram), 1e-300))
    step = -np.linalg.lstsq(gram * np.outer(scale, scale), right * scale, rcond=1e-12)[0] * scale
    return linear[0].shared.moved(step[:shared_columns]), [
        trial.bases.moved(step[shared_columns + own * t : shared_columns + own * (t + 1)])
        for t, trial in enumerate(linear)
    ]
