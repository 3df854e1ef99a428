"""Estimate the inertia matrix about the centre of mass from motion (paper, section III-D).

{b} is at the estimated centre of mass with the axes of {s} = {1}. Moments are taken about the centre of mass, so its
acceleration does not enter: m_b = I alpha + omega x I omega, equation (18).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from estimator import so3
from estimator.arrays import ORDER, Array, inertia_matrix, inertia_parameters, point_inertia
from estimator.estimate.grasps import GraspEstimate
from estimator.estimate.uncertainty import (
    StepReport,
    WeakDirection,
    Window,
    axis,
    combination,
    judge,
    standard_errors,
    window_covariance,
    window_normals,
    windows,
)
from estimator.rigid_team import (
    acceleration_noise,
    fuse,
    fusion_changes,
    inertia_regressor,
    inertia_regressor_changes,
)
from estimator.signals import GraspData
from estimator.statistics import rms

AXES_SE_LIMIT_RAD = np.deg2rad(20)
"""Largest standard error of reported principal axes."""


@dataclass(frozen=True)
class PrincipalInertia:
    """Principal moments and axes.

    Attributes:
        moments: principal moments, ascending [kg m^2], shape (3,).
        moments_se: their standard errors [kg m^2], shape (3,).
        R_1c: principal axes as columns in {1} (= axes of {b}), right-handed, shape (3, 3). The signs give the smallest
            rotation angle of the four choices, as in Table I. None if undetermined.
        R_1c_covariance: covariance of the error rotation in {1} [rad^2], shape (3, 3), or None.
    """

    moments: Array
    moments_se: Array
    R_1c: Array | None
    R_1c_covariance: Array | None

    @property
    def axis_angle_rad(self) -> Array | None:
        """Rotation vector of R_1c [rad], shape (3,), or None."""
        return None if self.R_1c is None else Rotation.from_matrix(self.R_1c).as_rotvec()

    @property
    def axis_angle_se_rad(self) -> Array | None:
        """Standard errors of the components of the rotation vector [rad], shape (3,), or None."""
        if self.R_1c is None or self.R_1c_covariance is None:
            return None
        return standard_errors(so3.rotvec_covariance(self.R_1c, self.R_1c_covariance))

    def to_dict(self) -> dict[str, Any]:
        """Convert to plain types; see ``estimator.estimate.result``."""
        axes, axes_se, covariance = self.axis_angle_rad, self.axis_angle_se_rad, self.R_1c_covariance
        return {
            "principal_kgm2": self.moments.tolist(),
            "principal_se_kgm2": self.moments_se.tolist(),
            "R_1c_axis_angle_deg": None if axes is None else np.rad2deg(axes).tolist(),
            "R_1c_se_deg": None if axes_se is None else np.rad2deg(axes_se).tolist(),
            "R_1c_covariance_rad2": None if covariance is None else covariance.tolist(),
        }

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> PrincipalInertia:
        """Inverse of ``to_dict``; other keys are ignored."""
        axes, covariance = values["R_1c_axis_angle_deg"], values["R_1c_covariance_rad2"]
        return cls(
            np.array(values["principal_kgm2"]),
            np.array(values["principal_se_kgm2"]),
            None if axes is None else Rotation.from_rotvec(axes, degrees=True).as_matrix(),
            None if covariance is None else np.array(covariance),
        )


def about_origin(mass: float, c: Array, inertia: Array) -> Array:
    """Return (m, m c, J about the origin), shape (10,), from mass [kg], centre of mass c [m], inertia [kg m^2]."""
    about = inertia + mass * point_inertia(c)
    return np.concatenate([[mass], mass * c, inertia_parameters(about)])


def about_com(parameters: Array) -> Array:
    """Inverse of ``about_origin``: return (m, c, inertia about c), shape (10,)."""
    m = parameters[0]
    c = parameters[1:4] / m
    inertia = inertia_matrix(parameters[4:]) - m * point_inertia(c)
    return np.concatenate([[m], c, inertia_parameters(inertia)])


def project_positive(inertia: Array) -> tuple[Array, bool]:
    """Replace negative eigenvalues by zero (footnote 1); also return whether there were any."""
    values, vectors = np.linalg.eigh(inertia)
    if values[0] >= 0:
        return inertia, False
    return (vectors * np.maximum(values, 0.0)) @ vectors.T, True


def principal_inertia(inertia: Array, covariance: Array) -> PrincipalInertia:
    """Return principal moments and axes, equation (27), with standard errors by first-order perturbation.

    Args:
        inertia: matrix in {b}, axes of {1} [kg m^2], shape (3, 3).
        covariance: of its six parameters (20) [kg^2 m^4], shape (6, 6).
    """
    moments, axes = np.linalg.eigh(inertia)
    axes = _smallest_rotation(axes)
    # r_k^T dI r_l as a linear map of the six parameters; off-diagonal entries count twice.
    maps = {}
    for k in range(3):
        for m in range(k, 3):
            outer = np.outer(axes[:, k], axes[:, m])
            maps[k, m] = np.array([outer[a, b] + (outer[b, a] if a != b else 0.0) for a, b in ORDER])
    J = np.array([maps[k, k] for k in range(3)])
    moments_se = standard_errors(J @ covariance @ J.T)

    # Error rotation about c mixes a and b: (r_b^T dI r_a) / (lambda_a - lambda_b), (a, b, c) cyclic.
    with np.errstate(divide="ignore", invalid="ignore"):
        about = np.array(
            [maps[min(a, b), max(a, b)] / (moments[a] - moments[b]) for a, b in ((1, 2), (2, 0), (0, 1))]
        )
    rotation = about @ covariance @ about.T if np.all(np.isfinite(about)) else np.full((3, 3), np.inf)
    if not np.all(np.diag(rotation) < AXES_SE_LIMIT_RAD**2):
        return PrincipalInertia(moments, moments_se, None, None)
    return PrincipalInertia(moments, moments_se, axes, axes @ rotation @ axes.T)


def _smallest_rotation(axes: Array) -> Array:
    """Choose the signs of the columns for a right-handed matrix with the smallest rotation angle."""
    choices = [axes * np.array(signs) for signs in ((1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1))]
    choices = [R if np.linalg.det(R) > 0 else -R for R in choices]
    return max(choices, key=np.trace)


PARAMETERS = ("Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")
SE_LIMIT = 1 / 3
"""Largest standard error of a determined direction, relative to the payload's typical inertia."""
UNCERTAIN = "its standard error is as large as a third of the inertia"
_JACOBIAN_SAMPLES = 1000  # sufficient to propagate the covariance of grasps and CoM


@dataclass(frozen=True)
class InertiaEstimate:
    """Inertia in {b}.

    Attributes:
        inertia: matrix about the centre of mass in the axes of {1} [kg m^2], shape (3, 3).
        covariance: of (Ixx, Ixy, Ixz, Iyy, Iyz, Izz) [kg^2 m^4], including errors of grasps and CoM, (6, 6).
        principal: moments and axes.
        projected: True if a negative eigenvalue was replaced by zero (footnote 1).
        residual_rms: rms per component of the moment balance about the CoM [N m].
        moment_rms: rms per component of the moment that the inertia explains [N m].
    """

    inertia: Array
    covariance: Array
    principal: PrincipalInertia
    projected: bool
    residual_rms: float
    moment_rms: float

    @classmethod
    def of(
        cls, parameters: Array, covariance: Array, residual_rms: float, moment_rms: float
    ) -> InertiaEstimate:
        """Make the estimate from the six parameters of (20), projected to positive (footnote 1); see the attributes."""
        inertia, projected = project_positive(inertia_matrix(parameters))
        principal = principal_inertia(inertia, covariance)
        return cls(inertia, covariance, principal, projected, residual_rms, moment_rms)

    def judged(self, report: StepReport) -> StepReport:
        """Add the directions to the report whose standard error is too large for the size of the inertia."""
        return refuse_uncertain(report, self.covariance, SE_LIMIT * float(np.trace(self.inertia)) / 3)

    def to_dict(self) -> dict[str, Any]:
        """Convert to plain types; see ``estimator.estimate.result``."""
        return {
            "I_b_kgm2": self.inertia.tolist(),
            "I_b_se_kgm2": inertia_matrix(standard_errors(self.covariance)).tolist(),
            "covariance_kg2m4": self.covariance.tolist(),
            **self.principal.to_dict(),
            "projected": self.projected,
            "residual_Nm": self.residual_rms,
            "moment_Nm": self.moment_rms,
        }

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> InertiaEstimate:
        """Inverse of ``to_dict``."""
        return cls(
            np.array(values["I_b_kgm2"]),
            np.array(values["covariance_kg2m4"]),
            PrincipalInertia.from_dict(values),
            values["projected"],
            values["residual_Nm"],
            values["moment_Nm"],
        )


def estimate_inertia(
    trials: Sequence[GraspData],
    grasps: GraspEstimate,
    p_1c: Array,
    upstream: tuple[Array, Array] | None = None,
) -> tuple[InertiaEstimate | None, StepReport]:
    """Estimate the inertia by (26) from one or several trials.

    Args:
        trials: motion of the same payload.
        grasps: the grasp frames.
        p_1c: centre of mass in {1} [m], shape (3,).
        upstream: covariance of p_1c without grasp errors, shape (3, 3), and derivative of p_1c by the grasp errors,
            shape (3, 6(N-1)); None takes p_1c as exact.

    Returns:
        The estimate, or None if a direction is undetermined, and the report.
    """
    parts = [_equations(trial, grasps, p_1c) for trial in trials]
    X, y = np.concatenate([part[0] for part in parts]), np.concatenate([part[1] for part in parts])
    alpha_noise = rms([acceleration_noise(trial, grasps) for trial in trials])
    report = rotational_excitation(X, alpha_noise)
    if not report.determined:
        return None, report
    parameters = _solve(X, y)
    residual = y - X @ parameters
    noise, signal = rms(residual), rms(X @ parameters)
    if signal < noise:
        why = f"the moments do not follow the motion (explained {signal:.2g} N m, left {noise:.2g} N m)"
        return None, refuse(report, np.eye(6), why)

    covariance = window_covariance(*window_normals(X, residual, trial_windows(trials)))
    moment_scale, alpha_scale = rms(y), np.sqrt(np.mean(X[:, 0, 0] ** 2 + X[:, 1, 1] ** 2))
    report = refuse_uncertain(report, covariance, SE_LIMIT * moment_scale / alpha_scale)
    if not report.determined:
        return None, report

    if upstream is not None:
        covariance = covariance + _upstream_covariance(trials, grasps, p_1c, *upstream)
    return InertiaEstimate.of(parameters, covariance, noise, signal), report


def trial_windows(trials: Sequence[GraspData]) -> list[Window]:
    """Return windows over the concatenated samples of several trials."""
    out, first = [], 0
    for trial in trials:
        out += windows(trial.samples, trial.rate_hz, first)
        first += trial.samples
    return out


def rotational_excitation(X: Array, alpha_noise: float) -> StepReport:
    """Judge the regressor (Q, 3, 6) against the noise of the angular acceleration [rad/s^2]."""
    flat = X.reshape(-1, 6)
    return judge(
        "inertia",
        PARAMETERS,
        flat.T @ flat / len(X),
        alpha_noise,
        unit="rad/s^2",
        reason="the rotations do not excite it",
        floor=1e-8,
    )


def refuse(report: StepReport, directions: Array, why: str) -> StepReport:
    """Add the given directions (K, parameters) to the report as undetermined."""
    weak = []
    for d in directions:
        d = d * np.sign(d[np.argmax(np.abs(d))])
        words = f"along {axis(d)} of {{1}}" if len(d) == 3 else combination(d, report.parameters)
        weak.append(WeakDirection(report.step, words, tuple(float(v) for v in d), why))
    return replace(report, weak=(*report.weak, *weak))


def refuse_uncertain(report: StepReport, covariance: Array, limit: float, why: str = UNCERTAIN) -> StepReport:
    """Add the directions whose standard error exceeds a limit to the report as undetermined."""
    values, vectors = np.linalg.eigh(covariance)
    return refuse(report, vectors[:, np.sqrt(np.maximum(values, 0.0)) > limit].T, why)


def _equations(trial: GraspData, grasps: GraspEstimate, p_1c: Array) -> tuple[Array, Array]:
    """Return regressor (Q, 3, 6) and moments about the CoM (Q, 3), equations (19), (21)-(24)."""
    motion = fuse(trial, grasps)
    return inertia_regressor(motion.omega, motion.alpha), motion.moment - np.cross(p_1c, motion.force)


def _solve(X: Array, y: Array) -> Array:
    flat = X.reshape(-1, 6)
    return np.asarray(np.linalg.solve(flat.T @ flat, flat.T @ y.ravel()), dtype=float)


def _upstream_covariance(
    trials: Sequence[GraspData],
    grasps: GraspEstimate,
    p_1c: Array,
    com_covariance: Array,
    com_by_grasp: Array,
) -> Array:
    """Return the covariance of the inertia due to errors of the CoM and of the grasps, which also move the CoM."""
    J = by_upstream(thinned(trials), grasps, p_1c, com_by_grasp)
    K = len(grasps.covariance)
    return J[:, :K] @ grasps.covariance @ J[:, :K].T + J[:, K:] @ com_covariance @ J[:, K:].T


def by_upstream(
    trials: Sequence[GraspData], grasps: GraspEstimate, p_1c: Array, com_by_grasp: Array
) -> Array:
    """Return the derivative of the parameters (26) by grasp errors, which also move the CoM, and by the CoM, (6, K+3).

    Differentiating the normal equations of X x = y with residual r: X^T X dx = dX^T r + X^T (dy - dX x).

    Args:
        trials, grasps, p_1c: as for ``estimate_inertia``.
        com_by_grasp: derivative of p_1c by the grasp errors, shape (3, K), K = 6(N-1).
    """
    K = len(grasps.covariance)
    normal, right = np.zeros((6, 6)), np.zeros((6, K + 3))
    equations = [_equations(trial, grasps, p_1c) for trial in trials]
    parameters = _solve(*(np.concatenate(part) for part in zip(*equations, strict=True)))
    inertia = inertia_matrix(parameters)
    by_com = np.concatenate([com_by_grasp, np.eye(3)], axis=1)
    for trial, (X, y) in zip(trials, equations, strict=True):
        motion = fuse(trial, grasps)
        omega, flat = motion.omega, X.reshape(-1, 6)
        residual = y - X @ parameters
        d = fusion_changes(trial.twist, trial.twist_dot, trial.R_bi, trial.wrench, grasps)
        d_omega, d_alpha = d.twist[..., :3], d.twist_dot[..., :3]
        dy = np.zeros((K + 3, *omega.shape))
        dy[:K] = d.moment - so3.cross(p_1c, d.force)
        dy[:K] -= d_alpha @ inertia
        dy[:K] -= so3.cross(d_omega, omega @ inertia) + so3.cross(omega, d_omega @ inertia)
        dy -= so3.cross(by_com.T[:, None], motion.force)
        normal += flat.T @ flat
        right += flat.T @ dy.reshape(K + 3, -1).T
        right[:, :K] += inertia_regressor_changes(omega, d_omega, d_alpha, residual).T
    return np.asarray(np.linalg.solve(normal, right), dtype=np.float64)


def thinned(trials: Sequence[GraspData]) -> list[GraspData]:
    """Return evenly spaced samples of the trials, about a thousand in all."""
    stride = max(1, sum(trial.samples for trial in trials) // _JACOBIAN_SAMPLES)
    return [trial.every(stride) for trial in trials]
