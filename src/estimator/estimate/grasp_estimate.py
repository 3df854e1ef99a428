"""The estimated grasp frames, with their covariance, for any pair of robots."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from estimator import so3
from estimator.arrays import Array
from estimator.estimate.uncertainty import norm_se, standard_errors


@dataclass(frozen=True)
class PairGrasp:
    """Frame {j} relative to {i}, with standard errors.

    Attributes:
        i, j: robots, counted from 1.
        R_ij: rotation, shape (3, 3).
        p_ij: origin of {j} in {i} [m], shape (3,).
        covariance: of (error rotation d in {i} [rad], e [m]), shape (6, 6): the truth is
            exp(d) R_ij, p_ij + e.
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
        """Plain types; see ``estimator.estimate.result``."""
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
        covariance: of (d_2, e_2, d_3, e_3, ...), shape (6(N-1), 6(N-1)): the truth is exp(d_i) R_1i and
            p_1i + e_i, with d_i [rad] and e_i [m] both in {1}.
        angular_residual_rms: rms per component of omega_i - R_ij omega_j [rad/s], shape (N, N).
        linear_residual_rms: rms per component of v_i - R_ij v_j - [p_ij] omega [m/s], omega being the mean
            of all robots' angular velocities in {i}, shape (N, N), symmetric like the angular one.
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
        """T_ij with its covariance; robots counted from 1.

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
        """The same with errors x = (d_2, e_2, ...), shape (6(N-1),), applied as in ``covariance``."""
        x = np.asarray(x).reshape(-1, 6)
        R, p = self.R_1i.copy(), self.p_1i.copy()
        if len(x):
            R[1:], p[1:] = Rotation.from_rotvec(x[:, :3]).as_matrix() @ R[1:], p[1:] + x[:, 3:]
        return replace(self, R_1i=R, p_1i=p)

    def rounded(self, still_rad2: Array) -> GraspEstimate:
        """The same with errors of every robot's tilt that last, of so much variance about every axis, shape (N,)."""
        own = np.kron(still_rad2[1:], [1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
        first = np.reshape([[np.eye(3), -so3.skew(p)] for p in self.p_1i[1:]], (-1, 3))
        return replace(self, covariance=self.covariance + np.diag(own) + still_rad2[0] * first @ first.T)

    def to_dict(self) -> dict[str, Any]:
        """Plain types; see ``estimator.estimate.result``."""
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
        """Inverse of ``to_dict``, for a number of robots N."""
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
    """The grasp "estimate" of a team of one: {1} in {1}, exactly."""
    nothing = np.zeros((1, 1))
    return GraspEstimate(
        np.eye(3)[None], np.zeros((1, 3)), np.zeros((0, 0)), nothing, nothing, np.zeros(1), np.zeros(1)
    )
