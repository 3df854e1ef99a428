"""Estimate relative grasp frames from twists (paper, section III-B): Wahba, positions, refinement over all pairs.

The refinement has the unknowns T_12, ..., T_1N only. Every other T_ij is T_1i^-1 T_1j by construction, so all loops
close exactly and need no constraint. It minimises the weighted squares of the residuals of all pairs i < j,

    e_w = R_1i omega_i - R_1j omega_j,    e_v = R_1i v_i - R_1j v_j - [p_1j - p_1i] w.

This is equation (2) rotated into {1}, except that w is the mean of R_1k omega_k over all robots instead of R_1j
omega_j. Noise in the angular velocity that multiplies p biases p toward zero. The mean has 1/N of that noise power, is
symmetric in the two robots of a pair, and does not depend on their numbering.

All residuals are linear in the stacked twists V = [V_1; ...; V_N] of a sample, so sums of their products depend on the
samples only through V V^T. The fit therefore uses a triangular 6N x 6N factor of all samples, and sums over windows
use the products V V^T.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from estimator import so3
from estimator.arrays import Array
from estimator.estimate.uncertainty import (
    StepReport,
    cross_information,
    judge,
    norm_se,
    standard_errors,
    window_covariance,
    windows,
)
from estimator.signals import GraspData
from estimator.statistics import rms


@dataclass(frozen=True)
class PairGrasp:
    """Rotation and origin [m] of frame {j} in {i}, robots counted from 1.

    The covariance (6, 6) is of (error rotation d in {i} [rad], e [m]): the true values are exp(d) R_ij and p_ij + e.
    """

    i: int
    j: int
    R_ij: Array
    p_ij: Array
    covariance: Array

    @property
    def axis_angle_rad(self) -> Array:
        """Rotation vector of R_ij [rad], shape (3,)."""
        return Rotation.from_matrix(self.R_ij).as_rotvec()

    @property
    def axis_angle_se_rad(self) -> Array:
        """Standard errors of the components of the rotation vector [rad], shape (3,)."""
        return standard_errors(so3.rotvec_covariance(self.R_ij, self.covariance[:3, :3]))

    @property
    def p_se_m(self) -> Array:
        """Standard errors of p_ij [m], shape (3,)."""
        return standard_errors(self.covariance[3:, 3:])

    @property
    def distance_se_m(self) -> float:
        """Standard error of |p_ij| [m]."""
        return norm_se(self.p_ij, self.covariance[3:, 3:])

    def to_dict(self) -> dict[str, Any]:
        """Convert to plain types; see ``estimator.estimate.result``."""
        return {
            "i": self.i,
            "j": self.j,
            "R_axis_angle_deg": np.rad2deg(self.axis_angle_rad).tolist(),
            "R_se_deg": np.rad2deg(self.axis_angle_se_rad).tolist(),
            "p_m": self.p_ij.tolist(),
            "p_se_m": self.p_se_m.tolist(),
            "distance_m": float(np.linalg.norm(self.p_ij)),
            "distance_se_m": self.distance_se_m,
        }


@dataclass(frozen=True)
class GraspEstimate:
    """Grasp frames {i} in {1} = {s}; index 0 of the first axis is robot 1 itself.

    Every T_ij follows as T_1i^-1 T_1j, so all loops T_ij T_jk T_ki = I close exactly.

    Attributes:
        R_1i: rotations, shape (N, 3, 3).
        p_1i: origins [m], shape (N, 3).
        covariance: of (d_2, e_2, d_3, e_3, ...), shape (6(N-1), 6(N-1)): the true values are exp(d_i) R_1i and p_1i +
            e_i, with d_i [rad] and e_i [m] both in {1}.
        angular_residual_rms: rms per component of omega_i - R_ij omega_j [rad/s], shape (N, N).
        linear_residual_rms: rms per component of v_i - R_ij v_j - [p_ij] omega [m/s], shape (N, N), symmetric. omega
            is the mean of all robots' angular velocities in {i}.
        angular_motion_rms: rms per component of omega_i [rad/s], shape (N,).
        linear_motion_rms: rms per component of v_i [m/s], shape (N,).
    """

    R_1i: Array
    p_1i: Array
    covariance: Array
    angular_residual_rms: Array
    linear_residual_rms: Array
    angular_motion_rms: Array
    linear_motion_rms: Array

    @property
    def robots(self) -> int:
        """Number of robots N."""
        return len(self.p_1i)

    def T(self, i: int, j: int) -> Array:
        """Homogeneous transform T_ij of frame {j} in {i}, shape (4, 4); robots counted from 1."""
        a, b = self._index(i), self._index(j)
        T = np.eye(4)
        T[:3, :3] = self.R_1i[a].T @ self.R_1i[b]
        T[:3, 3] = self.R_1i[a].T @ (self.p_1i[b] - self.p_1i[a])
        return T

    def pair(self, i: int, j: int) -> PairGrasp:
        """Return T_ij with its covariance; robots counted from 1.

        Raises:
            ValueError: a robot number is outside 1..N.
        """
        T = self.T(i, j)
        a, b = self._index(i), self._index(j)
        R_i1 = self.R_1i[a].T
        J = np.zeros((6, 6 * self.robots))
        J[:3, 6 * b : 6 * b + 3] += R_i1
        J[:3, 6 * a : 6 * a + 3] -= R_i1
        J[3:, 6 * b + 3 : 6 * b + 6] += R_i1
        J[3:, 6 * a + 3 : 6 * a + 6] -= R_i1
        J[3:, 6 * a : 6 * a + 3] += R_i1 @ so3.skew(self.p_1i[b] - self.p_1i[a])
        J = J[:, 6:]  # robot 1 is the reference
        return PairGrasp(i, j, T[:3, :3], T[:3, 3], J @ self.covariance @ J.T)

    def moved(self, x: Array) -> GraspEstimate:
        """Add errors x = (d_2, e_2, ...), shape (6(N-1),), as defined in ``covariance``."""
        x = np.asarray(x).reshape(-1, 6)
        R, p = self.R_1i.copy(), self.p_1i.copy()
        if len(x):
            R[1:], p[1:] = Rotation.from_rotvec(x[:, :3]).as_matrix() @ R[1:], p[1:] + x[:, 3:]
        return replace(self, R_1i=R, p_1i=p)

    def rounded(self, still_rad2: Array) -> GraspEstimate:
        """Add the covariance of constant tilt errors of the robots, with this variance about each axis, shape (N,)."""
        own = np.kron(still_rad2[1:], [1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
        first = np.reshape([[np.eye(3), -so3.skew(p)] for p in self.p_1i[1:]], (-1, 3))
        return replace(self, covariance=self.covariance + np.diag(own) + still_rad2[0] * first @ first.T)

    def to_dict(self) -> dict[str, Any]:
        """Convert to plain types; see ``estimator.estimate.result``."""
        return {
            "pairs": [
                self.pair(i, j).to_dict()
                | {
                    "angular_residual_radps": float(self.angular_residual_rms[i - 1, j - 1]),
                    "linear_residual_mps": float(self.linear_residual_rms[i - 1, j - 1]),
                }
                for i, j in combinations(range(1, self.robots + 1), 2)
            ],
            "covariance": self.covariance.tolist(),
            "angular_residual_radps": self.angular_residual_rms.tolist(),
            "linear_residual_mps": self.linear_residual_rms.tolist(),
            "angular_motion_radps": self.angular_motion_rms.tolist(),
            "linear_motion_mps": self.linear_motion_rms.tolist(),
        }

    @classmethod
    def from_dict(cls, values: dict[str, Any], robots: int) -> GraspEstimate:
        """Inverse of ``to_dict`` for N robots."""
        R, p, size = np.tile(np.eye(3), (robots, 1, 1)), np.zeros((robots, 3)), 6 * (robots - 1)
        for pair in values["pairs"]:
            if pair["i"] == 1:
                R[pair["j"] - 1] = Rotation.from_rotvec(pair["R_axis_angle_deg"], degrees=True).as_matrix()
                p[pair["j"] - 1] = pair["p_m"]
        return cls(
            R,
            p,
            np.array(values["covariance"], dtype=float).reshape(size, size),
            np.array(values["angular_residual_radps"]),
            np.array(values["linear_residual_mps"]),
            np.array(values["angular_motion_radps"]),
            np.array(values["linear_motion_mps"]),
        )

    def _index(self, robot: int) -> int:
        if not 1 <= robot <= self.robots:
            raise ValueError(f"robot {robot} is not one of 1..{self.robots}")
        return robot - 1


def single_robot() -> GraspEstimate:
    """Return the exact grasp of a single robot: {1} in {1}."""
    nothing = np.zeros((1, 1))
    return GraspEstimate(
        np.eye(3)[None], np.zeros((1, 3)), np.zeros((0, 0)), nothing, nothing, np.zeros(1), np.zeros(1)
    )


RATE_FLOOR_RADPS = 1e-10
"""Angular velocity below which it is rounding error of differenced angles [rad/s]."""


def pair_rotation(omega_i: Array, omega_j: Array) -> Array:
    """Return R_ij that best maps angular velocities omega_j to omega_i, (Q, 3) (Wahba's problem), equations (3)-(5)."""
    with warnings.catch_warnings():  # scipy warns if R is not unique; the caller checks the excitation
        warnings.simplefilter("ignore", UserWarning)
        return Rotation.align_vectors(omega_i, omega_j)[0].as_matrix()


def pair_position(twist_i: Array, twist_j: Array, R_ij: Array) -> Array:
    """Return p_ij [m] that best explains the linear velocities of twists (omega, v) in {i} and {j}, shape (Q, 6).

    Equations (6)-(8); the shortest solution if it is not unique.
    """
    A = so3.skew(twist_j[:, :3] @ R_ij.T).reshape(-1, 3)
    b = (twist_j[:, 3:] @ R_ij.T - twist_i[:, 3:]).ravel()
    return np.asarray(np.linalg.lstsq(A, b, rcond=None)[0], dtype=float)


def estimate_grasps(trials: Sequence[GraspData]) -> tuple[GraspEstimate | None, tuple[StepReport, ...]]:
    """Estimate grasp frames of all N robots from one or several trials of a payload, weighted by samples and motion.

    Returns:
        The estimate, or None if some T_1j is undetermined, and two reports per robot j > 1 (rotation, position). For N
        = 1 the estimate is exact and there are no reports.
    """
    N = trials[0].robots
    if N == 1:
        return single_robot(), ()
    stacked = [trial.twist.reshape(trial.samples, -1) for trial in trials]  # (Q, 6N)
    samples = sum(trial.samples for trial in trials)
    pooled = _triangle(np.concatenate([_triangle(V) for V in stacked]))  # (6N, 6N)
    V = pooled.reshape(-1, N, 6)  # its rows replace the samples

    R, p, reports = np.tile(np.eye(3), (N, 1, 1)), np.zeros((N, 3)), []
    for j in range(1, N):
        R[j] = pair_rotation(V[:, 0, :3], V[:, j, :3])
        p[j] = pair_position(V[:, 0], V[:, j], R[j])
        reports += _excitation(V[:, 0], V[:, j], R[j], p[j], j + 1, samples)
    if not all(report.determined for report in reports):
        return None, tuple(reports)

    weights = np.ones((2, 1, 1))
    for _ in range(2):  # the second pass removes the dependence of the weights on the initial pairs
        weights = _weights(V, R, p)
        R, p = _refine(V, R, p, weights)

    covariance = window_covariance(*_window_sums(trials, stacked, R, p, weights))

    mean = 3 * samples
    pair_rms = np.zeros((2, N, N))
    for (i, j), e in zip(_pairs(N), _residuals(V, R, p), strict=True):
        pair_rms[:, i, j] = pair_rms[:, j, i] = np.sqrt(np.sum(e**2, axis=(1, 2)) / mean)
    motion = np.sqrt(np.sum(V.reshape(-1, N, 2, 3) ** 2, axis=(0, 3)) / mean)
    estimate = GraspEstimate(R, p, covariance, pair_rms[0], pair_rms[1], motion[:, 0], motion[:, 1])
    return estimate, tuple(reports)


def _excitation(V_1: Array, V_j: Array, R: Array, p: Array, robot: int, samples: int) -> list[StepReport]:
    """Judge whether the payload turns about at least two axes, clearly above the disagreement of the two robots."""
    information = cross_information(V_1[:, :3]) * len(V_1) / samples
    e_w = V_1[:, :3] - V_j[:, :3] @ R.T
    e_v = V_1[:, 3:] - V_j[:, 3:] @ R.T + np.cross(V_j[:, :3] @ R.T, p)
    noise_w, noise_v = (float(np.sqrt(np.sum(e**2) / (3 * samples))) for e in (e_w, e_v))
    # Scaled by 1 m: compare the velocity due to a position error of 1 m with the velocity residual.
    # If the rotation is undetermined, that residual is meaningless; use the noise of the rates instead.
    common: Any = {
        "frame": "{1}", "floor": RATE_FLOOR_RADPS,
        "reason": "the payload does not turn enough about any axis across it",
    }  # fmt: skip
    about, along = ("about x", "about y", "about z"), ("x", "y", "z")
    rotation = judge(
        f"rotation R_1{robot}", about, information, noise_w, unit="rad/s", words="about", **common
    )
    noise = noise_v if rotation.determined else noise_w
    name = f"position p_1{robot}"
    return [rotation, judge(name, along, information, noise, unit="m/s per m", words="along", **common)]


def _weights(V: Array, R: Array, p: Array) -> Array:
    """Return weights (2, 1, 1) of angular and linear residuals: inverse of their rms, relative to the angular one."""
    r = _residuals(V, R, p)
    motion = rms(V[..., :3]), rms(V[..., 3:])
    # Avoid division by zero for exact data.
    left = [max(rms(r[:, k]), 1e-12 * motion[k], 1e-300) for k in (0, 1)]
    return np.array([1.0, left[0] / left[1]])[:, None, None]


def _refine(V: Array, R: Array, p: Array, weights: Array) -> tuple[Array, Array]:
    """Minimize over T_12..T_1N on the manifold, starting at (R, p)."""
    N = len(p)
    R_0, p_0 = R.copy(), p.copy()

    def frames(x: Array) -> tuple[Array, Array]:
        x = x.reshape(N - 1, 6)
        R = Rotation.from_rotvec(x[:, :3]).as_matrix() @ R_0[1:]
        return np.concatenate([R_0[:1], R]), np.concatenate([p_0[:1], p_0[1:] + x[:, 3:]])

    def residuals(x: Array) -> Array:
        return (weights * _residuals(V, *frames(x))).ravel()

    def jacobian(x: Array) -> Array:
        J = weights[..., None] * _jacobian(V, *frames(x))  # with respect to a left error rotation
        for k, phi in enumerate(x.reshape(N - 1, 6)[:, :3]):
            J[..., 6 * k : 6 * k + 3] = J[..., 6 * k : 6 * k + 3] @ so3.left_jacobian(phi)
        return J.reshape(-1, 6 * (N - 1))

    start = np.zeros(6 * (N - 1))
    size = float(np.sqrt(np.sum(jacobian(start) ** 2)))  # normalizes the cost, independently of units
    solution = least_squares(
        lambda x: residuals(x) / size,
        start,
        jac=lambda x: jacobian(x) / size,  # type: ignore[arg-type]
        method="lm",
        xtol=1e-15,
        ftol=1e-15,
        gtol=1e-15,
    )
    return frames(solution.x)


def _pairs(N: int) -> list[tuple[int, int]]:
    return [(i, j) for i in range(N) for j in range(i + 1, N)]


def _residuals(V: Array, R: Array, p: Array) -> Array:
    """Return residuals (e_w, e_v) in {1} of all pairs, shapes (Q, N, 6) -> (pairs, 2, Q, 3)."""
    w, u = np.einsum("iab,qib->iqa", R, V[..., :3]), np.einsum("iab,qib->iqa", R, V[..., 3:])
    i, j = np.array(_pairs(len(p))).T
    e_v = u[i] - u[j] - np.cross((p[j] - p[i])[:, None], w.mean(axis=0))
    return np.stack([w[i] - w[j], e_v], axis=1)


def _jacobian(V: Array, R: Array, p: Array) -> Array:
    """Return the derivative of ``_residuals`` by (d_2, e_2, ...), R_1i -> exp(d_i) R_1i, p_1i -> p_1i + e_i.

    Shape (pairs, 2, Q, 3, 6(N-1)).
    """
    N = len(p)
    w, u = np.einsum("iab,qib->iqa", R, V[..., :3]), np.einsum("iab,qib->iqa", R, V[..., 3:])
    W, U = so3.skew(w), so3.skew(u)
    W_mean = W.mean(axis=0)
    J = np.zeros((len(_pairs(N)), 2, len(V), 3, N, 6))
    for k, (i, j) in enumerate(_pairs(N)):
        J[k, 0, :, :, i, :3], J[k, 0, :, :, j, :3] = -W[i], W[j]
        J[k, 1, ..., :3] = np.moveaxis(so3.skew(p[j] - p[i]) @ W / N, 0, -2)
        J[k, 1, :, :, i, :3] -= U[i]
        J[k, 1, :, :, j, :3] += U[j]
        J[k, 1, :, :, i, 3:], J[k, 1, :, :, j, 3:] = -W_mean, W_mean
    return J[..., 1:, :].reshape(*J.shape[:4], 6 * (N - 1))


def _triangle(V: Array) -> Array:
    """Return a square factor R with R^T R = V^T V, shapes (Q, K) -> (K, K)."""
    R = np.linalg.qr(V, mode="r")
    return np.vstack([R, np.zeros((V.shape[1] - len(R), V.shape[1]))])


def _window_sums(
    trials: Sequence[GraspData], stacked: Sequence[Array], R: Array, p: Array, weights: Array
) -> tuple[Array, Array]:
    """Return normal matrices (B, K, K) and scores (B, K) of all windows; K = 6(N-1).

    Residuals and derivatives are evaluated for unit twists, so that the sums over a window follow from its V V^T.
    """
    N = len(p)
    K, unit = 6 * (N - 1), np.eye(6 * N).reshape(-1, N, 6)
    r = np.moveaxis(weights * _residuals(unit, R, p), 2, 0).reshape(6 * N, -1)
    J = np.moveaxis(weights[..., None] * _jacobian(unit, R, p), 2, 0).reshape(6 * N, -1, K)
    products = np.array([
        (V[window.part].T * window.weights) @ V[window.part]
        for trial, V in zip(trials, stacked, strict=True)
        for window in windows(trial.samples, trial.rate_hz)
    ])  # fmt: skip
    normals, scores = np.zeros((len(products), K, K)), np.zeros((len(products), K))
    for row, of_row in enumerate(J):  # all at once would take (6N)^2 K^2 numbers
        with_others = products[:, row]
        normals += np.tensordot(with_others, np.tensordot(of_row, J, axes=(0, 1)), axes=(1, 1))
        scores += with_others @ (r @ of_row)
    return normals, scores
