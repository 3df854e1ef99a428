"""Mass, centre of mass and inertia in one least squares over the ten standard inertial parameters.

With a the acceleration of the origin of {1}, G = a + g up, c = p_1c and J the inertia about that origin,

    f = m G + [alpha] m c + [omega]^2 m c,
    M = m c x G + J alpha + omega x J omega,

linear in (m, m c, J). Needs no static hold, and the mass and centre of mass profit from the motion too.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag, null_space

from estimator import so3
from estimator.arrays import Array
from estimator.estimate.fusion import BodyMotion, acceleration_noise, fuse, tilt_scatter
from estimator.estimate.grasp_estimate import GraspEstimate
from estimator.estimate.identifiability import StepReport, cross_information
from estimator.estimate.inertia import (
    InertiaEstimate,
    inertia_regressor,
    refuse,
    refuse_uncertain,
    rotational_excitation,
    thinned,
    trial_windows,
)
from estimator.estimate.principal import inertia_parameters
from estimator.estimate.statics import ComEstimate, MassEstimate, check_lifted, judge_com
from estimator.estimate.uncertainty import WINDOW_S, numerical_jacobian, window_covariance, window_normals
from estimator.signals.grasp_data import GraspData
from estimator.statistics import rms


@dataclass(frozen=True)
class JointEstimate:
    """Result of the joint least squares.

    Attributes:
        mass, com, inertia: as the staged scheme gives them; None where not determined.
        covariance: of (m, p_1c, inertia parameters in {b}), shape (K, K) with K = 1, 4 or 10.
    """

    mass: MassEstimate
    com: ComEstimate | None
    inertia: InertiaEstimate | None
    covariance: Array


def newton_euler_regressor(omega: Array, alpha: Array, specific_force: Array) -> Array:
    """Regressor of (f, M) at the origin of {1} by (m, m c, Jxx, Jxy, Jxz, Jyy, Jyz, Jzz).

    Args:
        omega, alpha: angular velocity [rad/s] and acceleration [rad/s^2] in {1}, shape (Q, 3).
        specific_force: G = a + g up in {1} [m/s^2], shape (Q, 3).

    Returns:
        Shape (Q, 6, 10), force rows first.
    """
    W = so3.skew(omega)
    Y = np.zeros((len(omega), 6, 10))
    Y[:, :3, 0] = specific_force
    Y[:, :3, 1:4] = so3.skew(alpha) + W @ W
    Y[:, 3:, 1:4] = -so3.skew(specific_force)
    Y[:, 3:, 4:] = inertia_regressor(omega, alpha)
    return Y


def estimate_joint(
    trials: Sequence[GraspData], grasps: GraspEstimate, window_s: float = WINDOW_S, step: str = "inertia"
) -> tuple[JointEstimate, tuple[StepReport, ...]]:
    """Ten inertial parameters from any motion; fewer when the motion is poor.

    Args:
        trials: one or several trials of the same payload and N >= 1 robots, holds included.
        grasps: the grasp frames.
        window_s: length of the windows for the covariance [s].
        step: name of the inertia step in the reports.

    Returns:
        The estimate and the reports on the centre of mass and the inertia.

    Raises:
        InputError: the robots do not carry anything (the mass comes out as zero or negative).
    """
    motions = [fuse(trial, grasps) for trial in trials]
    Y, w, used = _equations(motions, trials)
    gravity = trials[0].gravity_mps2
    alpha_noise = rms([acceleration_noise(trial, grasps) for trial in trials])
    inertia_report = rotational_excitation(Y[:, 3:, 4:], alpha_noise, step)
    # Directions without excitation leave the fit, the others of an open inertia stay: they explain moments.
    turning = np.eye(6)
    basis = _blocks(np.eye(4), turning)
    theta, weights = _weighted_solve(_spanned(Y, basis), w)
    check_lifted(theta[0])
    residual = w - _spanned(Y, basis) @ theta
    force_rms, moment_rms = (rms(part) for part in (residual[:, :3], residual[:, 3:]))
    com_report = judge_com(
        cross_information(Y[:, :3, 0]) / gravity**2, moment_rms, theta[0] * gravity, _tilt_noise(trials, grasps),
        "the payload hardly tilts about any axis across it",
    )  # fmt: skip
    if not com_report.determined:
        basis = _blocks(np.eye(1), _excited(com_report), turning)
        theta, weights = _weighted_solve(_spanned(Y, basis), w)
        residual = w - _spanned(Y, basis) @ theta
        if inertia_report.determined:
            inertia_report = refuse(inertia_report, np.eye(6), "it needs the centre of mass")
    # How many of (m, p_1c, inertia) are reported.
    K = 1 if not com_report.determined else 4 if not inertia_report.determined else 10
    Y_b = _spanned(Y, basis)

    scale = np.sqrt(np.einsum("qrk,qrk->k", Y_b, Y_b) / used)
    parts = trial_windows(trials, window_s)
    J_weighted = weights[:, None] * Y_b
    J_weighted /= scale  # in place: these arrays are the largest of an estimate
    normals, scores = window_normals(J_weighted, weights * residual, parts)
    del J_weighted
    covariance = window_covariance(normals, scores) / np.outer(scale, scale)

    def moved(x: Array) -> Array:
        equations = _equations([fuse(trial, grasps.moved(x)) for trial in thin], thin)
        return _centred(_solve(_spanned(equations[0], basis), equations[1], weights), K)

    thin = thinned(trials)
    J_own = numerical_jacobian(lambda x: _centred(x, K), theta)
    J = numerical_jacobian(moved, np.zeros(len(grasps.covariance)))
    own_covariance = J_own @ covariance @ J_own.T
    covariance = own_covariance + J @ grasps.covariance @ J.T

    values = _centred(theta, K)
    mass = MassEstimate(float(values[0]), float(np.sqrt(covariance[0, 0])), force_rms)
    com = inertia = None
    if K >= 4:
        com = ComEstimate(
            float(values[0]), values[1:4], covariance[:4, :4], own_covariance[:4, :4], J[1:4], moment_rms
        )
    if K == 10:
        explained = rms(Y[:, 3:, 4:] @ theta[4:])
        inertia = InertiaEstimate.of(values[4:], covariance[4:, 4:], moment_rms, explained)
        typical = float(np.trace(inertia.inertia)) / 3
        inertia_report = refuse_uncertain(inertia_report, inertia.covariance, typical)
        inertia = inertia if inertia_report.determined else None
    return JointEstimate(mass, com, inertia, covariance), (com_report, inertia_report)


def _equations(motions: Sequence[BodyMotion], trials: Sequence[GraspData]) -> tuple[Array, Array, int]:
    """Regressor (Q, 6, 10), wrench (Q, 6) as (f, M), and Q over all trials."""
    Y = np.concatenate(
        [
            newton_euler_regressor(m.omega, m.alpha, m.acceleration + trial.gravity_mps2 * m.up)
            for m, trial in zip(motions, trials, strict=True)
        ]
    )
    w = np.concatenate([np.concatenate([m.force, m.moment], axis=1) for m in motions])
    return Y, w, len(w)


def _excited(report: StepReport) -> Array:
    """Orthonormal basis of the directions that are not weak, shape (parameters, directions)."""
    if report.determined:
        return np.eye(len(report.parameters))
    return np.asarray(null_space(np.array([direction.vector for direction in report.weak])), dtype=float)


def _spanned(Y: Array, basis: Array) -> Array:
    """Y @ basis, without a copy where nothing is left out."""
    complete = basis.shape[0] == basis.shape[1] and bool(np.all(basis == np.eye(len(basis))))
    return Y if complete else Y @ basis


def _blocks(*blocks: Array) -> Array:
    return np.asarray(block_diag(*blocks), dtype=float)


def _solve(Y: Array, w: Array, weights: Array) -> Array:
    """Least squares with weights (6,) of the rows."""
    A = (weights[:, None] * Y).reshape(-1, Y.shape[-1])
    scale = np.linalg.norm(A, axis=0)
    scale[scale == 0] = 1.0
    normal = (A.T @ A) / np.outer(scale, scale)
    right = A.T @ (weights * w).ravel() / scale
    return np.asarray(np.linalg.lstsq(normal, right, rcond=1e-14)[0] / scale, dtype=float)


def _weighted_solve(Y: Array, w: Array) -> tuple[Array, Array]:
    """The same with weights from the residuals of forces and of moments; parameters and weights."""
    weights = np.ones(6)
    # Exact data leave rounding error only, which says nothing about weights.
    floor = 1e-9 * np.sqrt(np.mean(w.reshape(-1, 2, 3) ** 2, axis=(0, 2))) + 1e-12
    for _ in range(2):
        residual = (w - Y @ _solve(Y, w, weights)).reshape(-1, 2, 3)
        left = np.maximum(np.sqrt(np.mean(residual**2, axis=(0, 2))), floor)
        weights = np.repeat(left[0] / left, 3)
    return _solve(Y, w, weights), weights


def _centred(parameters: Array, count: int) -> Array:
    """(m, m c, J about {1}, ...) -> the first 1, 4 or 10 of (m, c, inertia about c)."""
    m = parameters[0]
    if count == 1:
        return parameters[:1]
    c = parameters[1:4] / m
    out = np.concatenate([[m], c])
    if count == 4:
        return out
    shift = m * (c @ c * np.eye(3) - np.outer(c, c))
    return np.concatenate([out, parameters[4:] - inertia_parameters(shift)])


def _tilt_noise(trials: Sequence[GraspData], grasps: GraspEstimate) -> float:
    """Rms disagreement of the robots' tilts around each robot's constant offset [rad]."""
    if grasps.robots == 1:
        return 0.0
    total = sum(tilt_scatter(trial.R_bi, grasps) for trial in trials)
    count = 2 * (grasps.robots - 1) * sum(trial.samples for trial in trials)
    return float(np.sqrt(total / count))
