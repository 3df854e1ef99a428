"""Estimate mass, centre of mass and inertia in one least squares over the ten standard inertial parameters.

With a the acceleration of the origin of {1}, G = a + g up, c = p_1c and J the inertia about that origin,

    f = m G + [alpha] m c + [omega]^2 m c,
    M = m c x G + J alpha + omega x J omega,

linear in (m, m c, J). This needs no static hold, and motion also contributes to mass and centre of mass.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from estimator.arrays import Array
from estimator.estimate.grasps import GraspEstimate
from estimator.estimate.inertia import (
    InertiaEstimate,
    about_com,
    refuse,
    refuse_uncertain,
    rotational_excitation,
    thinned,
    trial_windows,
)
from estimator.estimate.statics import ComEstimate, MassEstimate, check_lifted, judge_com
from estimator.estimate.uncertainty import (
    StepReport,
    cross_information,
    numerical_jacobian,
    window_covariance,
    window_normals,
)
from estimator.rigid_team import acceleration_noise, payload_equations, tilt_scatter
from estimator.signals import GraspData
from estimator.statistics import rms

COM_SE_LIMIT_M = 0.3
"""Largest standard error of a reported centre of mass [m]. Chosen: a third of the size of a payload."""
_RANK = 1e-13  # share of the normal matrix below which a direction is rounding error
_OPEN = 1e12  # variance of undetermined directions, in rms of regressors


@dataclass(frozen=True)
class JointEstimate:
    """Result of the joint least squares.

    Attributes:
        mass, com, inertia: as in the staged method; None if undetermined.
        covariance: of (m, p_1c, inertia parameters in {b}), shape (K, K) with K = 1, 4 or 10 determined parameters.
        parameters: (m, m c, J about {1}), including undetermined ones, shape (10,).
    """

    mass: MassEstimate
    com: ComEstimate | None
    inertia: InertiaEstimate | None
    covariance: Array
    parameters: Array


def estimate_joint(
    trials: Sequence[GraspData], grasps: GraspEstimate
) -> tuple[JointEstimate, tuple[StepReport, ...]]:
    """Estimate ten inertial parameters from any motion of one payload, including holds; fewer if the motion is poor.

    Returns:
        The estimate, and the reports on the centre of mass and the inertia.

    Raises:
        InputError: the robots do not carry anything (the mass is zero or negative).
    """
    Y, w = _equations(trials, grasps)
    gravity = trials[0].gravity_mps2
    alpha_noise = rms([acceleration_noise(trial, grasps) for trial in trials])
    inertia_report = rotational_excitation(Y[:, 3:, 4:], alpha_noise)
    theta, weights = _weighted_solve(Y, w)
    check_lifted(theta[0])
    residual = w - Y @ theta
    force_rms, moment_rms = (rms(part) for part in (residual[:, :3], residual[:, 3:]))
    com_report = judge_com(
        cross_information(Y[:, :3, 0]) / gravity**2, moment_rms, theta[0] * gravity, _tilt_noise(trials, grasps),
        "the payload hardly tilts about any axis across it",
    )  # fmt: skip

    scale = np.sqrt(np.einsum("qrk,qrk->k", Y, Y) / len(w))
    scale[scale == 0] = 1.0
    parts = trial_windows(trials)
    J_weighted = weights[:, None] * Y
    J_weighted /= scale  # in place: these arrays are the largest of an estimate
    normals, scores = window_normals(J_weighted, weights * residual, parts)
    del J_weighted
    covariance = _open_covariance(normals, scores) / np.outer(scale, scale)

    def moved(x: Array) -> Array:
        return about_com(_solve(*_equations(thin, grasps.moved(x)), weights))

    # Keep all ten parameters in the fit: unreported ones add to the uncertainty of reported ones.
    thin = thinned(trials)
    J_own = numerical_jacobian(about_com, theta)
    J = numerical_jacobian(moved, np.zeros(len(grasps.covariance)))
    own_covariance = J_own @ covariance @ J_own.T
    covariance = own_covariance + J @ grasps.covariance @ J.T

    values = about_com(theta)
    mass = MassEstimate(float(values[0]), float(np.sqrt(covariance[0, 0])), force_rms)
    if com_report.determined:
        why = "its part cannot be told from the inertia's"
        com_report = refuse_uncertain(com_report, covariance[1:4, 1:4], COM_SE_LIMIT_M, why)
    com = inertia = None
    if com_report.determined:
        com = ComEstimate(
            float(values[0]), values[1:4], covariance[:4, :4], own_covariance[:4, :4], J[1:4], moment_rms
        )
    elif inertia_report.determined:
        inertia_report = refuse(inertia_report, np.eye(6), "it needs the centre of mass")
    if inertia_report.determined:
        explained = rms(Y[:, 3:, 4:] @ theta[4:])
        inertia = InertiaEstimate.of(values[4:], covariance[4:, 4:], moment_rms, explained)
        inertia_report = inertia.judged(inertia_report)
        inertia = inertia if inertia_report.determined else None
    K = 1 if com is None else 4 if inertia is None else 10
    return JointEstimate(mass, com, inertia, covariance[:K, :K], theta), (com_report, inertia_report)


def _open_covariance(normals: Array, scores: Array) -> Array:
    """Return ``window_covariance``, with a large variance for directions without any information."""
    values, axes = np.linalg.eigh(normals.sum(axis=0))
    told, open_ = axes[:, values > _RANK * values[-1]], axes[:, values <= _RANK * values[-1]]
    open_ = np.where(np.abs(open_) > 1e-6, open_, 0.0)
    return told @ window_covariance(told.T @ normals @ told, scores @ told) @ told.T + _OPEN * open_ @ open_.T


def _equations(trials: Sequence[GraspData], grasps: GraspEstimate) -> tuple[Array, Array]:
    """Return regressor (Q, 6, 10) and wrench (f, M) (Q, 6) over all trials."""
    parts = [payload_equations(trial, grasps) for trial in trials]
    return np.concatenate([Y for Y, _ in parts]), np.concatenate([w for _, w in parts])


def _solve(Y: Array, w: Array, weights: Array) -> Array:
    """Solve the least squares with row weights (6,)."""
    A = (weights[:, None] * Y).reshape(-1, Y.shape[-1])
    scale = np.linalg.norm(A, axis=0)
    scale[scale == 0] = 1.0
    normal = (A.T @ A) / np.outer(scale, scale)
    right = A.T @ (weights * w).ravel() / scale
    return np.asarray(np.linalg.lstsq(normal, right, rcond=_RANK)[0] / scale, dtype=float)


def _weighted_solve(Y: Array, w: Array) -> tuple[Array, Array]:
    """Solve with weights from the residuals of forces and of moments; return parameters and weights."""
    weights = np.ones(6)
    # Residuals of exact data are rounding errors, which must not determine weights.
    floor = 1e-9 * np.sqrt(np.mean(w.reshape(-1, 2, 3) ** 2, axis=(0, 2))) + 1e-12
    for _ in range(2):
        residual = (w - Y @ _solve(Y, w, weights)).reshape(-1, 2, 3)
        left = np.maximum(np.sqrt(np.mean(residual**2, axis=(0, 2))), floor)
        weights = np.repeat(left[0] / left, 3)
    return _solve(Y, w, weights), weights


def _tilt_noise(trials: Sequence[GraspData], grasps: GraspEstimate) -> float:
    """Return the rms disagreement of the robots' tilts about each robot's constant offset [rad]."""
    if grasps.robots == 1:
        return 0.0
    total = sum(tilt_scatter(trial.R_bi, grasps) for trial in trials)
    count = 2 * (grasps.robots - 1) * sum(trial.samples for trial in trials)
    return float(np.sqrt(total / count))
