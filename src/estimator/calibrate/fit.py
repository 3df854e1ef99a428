"""One nonlinear least squares over loops and balance of all trials: Gauss-Newton with priors on the robots."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, cho_factor, cho_solve

from estimator.arm.unit import AT
from estimator.arrays import Array
from estimator.calibrate import rules
from estimator.calibrate.equations import Rowed, TrialEquations
from estimator.calibrate.prior import Prior
from estimator.calibrate.unknowns import Layout, Unknowns


@dataclass(frozen=True, eq=False)
class Trial:
    """A trial with a payload.

    Attributes:
        equations: its rows.
        payload: which of the payloads it carries, from 0.
    """

    equations: TrialEquations
    payload: int


@dataclass(frozen=True, eq=False)
class Fit:
    """What came out.

    Attributes:
        unknowns: values.
        layout: where each lies in ``covariance``.
        covariance: of all unknowns, the mean spring scale held; zero for held ones, shape (K, K).
        by_scale: derivative of all unknowns by the common spring scale that is held, shape (K,).
        chi2: of every trial's rows, loops and balance [-], shape (trials, 2).
        count: numbers in them, shape (trials, 2).
        steps: Gauss-Newton steps.
        converged: whether the last step was small.
    """

    unknowns: Unknowns
    layout: Layout
    covariance: Array
    by_scale: Array
    chi2: Array
    count: NDArray[np.intp]
    steps: int
    converged: bool


def fit(
    trials: Sequence[Trial],
    start: Unknowns,
    prior: Prior,
    known_mass: Sequence[tuple[int, float, float]] = (),
) -> Fit:
    """Calibrate.

    Args:
        trials: those with a payload.
        start: values to start from.
        prior: spread of the robots.
        known_mass: payloads (from 0) with their weighed mass and its standard error [kg]; with one, the common spring
            scale is free.
    """
    layout = Layout(start.bases[0].R.shape[0], len(start.carried), len(trials))
    of_units = prior.factor(layout.robots, hold_scale=not known_mass)
    basis = np.asarray(block_diag(of_units, np.eye(layout.size - len(of_units))))
    # In these coordinates the robots' prior is standard normal.
    z, information = np.zeros(basis.shape[1]), np.zeros(basis.shape[1])
    information[: of_units.shape[1]] = 1.0
    at, step = start, 0
    adjustments: list[Array | None] = [None] * len(trials)
    while step < rules.MAX_STEPS:
        step += 1
        H, g = np.zeros((layout.size, layout.size)), np.zeros(layout.size)
        chi2, count = np.zeros((len(trials), 2)), np.zeros((len(trials), 2), dtype=np.intp)
        for k, trial in enumerate(trials):
            rowed = trial.equations.at(at.units, at.carried[trial.payload], at.bases[k], adjustments[k])
            adjustments[k] = rowed.adjustment
            index = np.r_[layout.of_units, layout.of_payload(trial.payload), layout.of_trial(k)]
            part, score, chi2[k], count[k] = _normal(rowed)
            H[np.ix_(index, index)] += part
            g[index] += score
        for payload, mass, se in known_mass:
            place = layout.of_inertia(payload).start
            H[place, place] += 1.0 / se**2
            g[place] += (at.carried[payload].pi[0] - mass) / se**2
        reduced = basis.T @ H @ basis + np.diag(information)
        scale = 1.0 / np.sqrt(np.diag(reduced))
        factor = cho_factor(reduced * np.outer(scale, scale))
        dz = -scale * cho_solve(factor, scale * (basis.T @ g + information * z))
        z += dz
        covariance_z = scale[:, None] * cho_solve(factor, np.diag(scale))
        at = layout.moved(at, basis @ dz)
        size = np.abs(dz) / np.sqrt(np.diag(covariance_z))
        if np.max(size) < rules.CONVERGED:
            break
    covariance = basis @ covariance_z @ basis.T
    common = np.zeros(layout.size)
    common[layout.unit_indices(np.r_[AT["stiffness_ratio"]])] = 1.0
    by_scale = common - basis @ (covariance_z @ (basis.T @ (H @ common)))
    if known_mass:
        by_scale = np.zeros(layout.size)
    return Fit(at, layout, covariance, by_scale, chi2, count, step, bool(np.max(size) < rules.CONVERGED))


def _normal(rowed: Rowed) -> tuple[Array, Array, Array, Array]:
    """Normal matrix and score of one trial, its chi2 of loops and of balance, and their counts."""
    n, C = rowed.residual.shape
    J = np.concatenate([rowed.by_units.reshape(n, C, -1), rowed.by_carried, rowed.by_bases], axis=2)
    factor = np.linalg.cholesky(rowed.covariance)
    white = np.linalg.solve(factor, np.concatenate([J, rowed.residual[..., None]], axis=2))
    flat = white.reshape(n * C, -1)
    gram = flat.T @ flat
    loops = np.sum(white[:, : C - 6, -1] ** 2)
    # Of the balance alone, not of what loops leave of it.
    own = np.linalg.solve(rowed.covariance[:, -6:, -6:], rowed.residual[:, -6:, None])[..., 0]
    balance = np.sum(own * rowed.residual[:, -6:])
    return gram[:-1, :-1], gram[:-1, -1], np.array([loops, balance]), np.array([n * (C - 6), n * 6])
