"""Principal moments and axes of an inertia matrix (paper, footnote 1 and equation (27))."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from estimator import so3
from estimator.arrays import Array
from estimator.estimate.uncertainty import standard_errors
from estimator.inertia import ORDER as ORDER
from estimator.inertia import inertia_matrix as inertia_matrix
from estimator.inertia import inertia_parameters as inertia_parameters

AXES_SE_LIMIT_RAD = np.deg2rad(20)
"""Principal axes less certain than this are not reported."""


@dataclass(frozen=True)
class PrincipalInertia:
    """Principal moments and axes.

    Attributes:
        moments: principal moments, ascending [kg m^2], shape (3,).
        moments_se: their standard errors [kg m^2], shape (3,).
        R_1c: principal axes as columns in {1} (= axes of {b}), right-handed, shape (3, 3); of the four
            choices of signs the one of smallest rotation angle, as in Table I. None when undetermined.
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
        """Plain types; see ``estimator.estimate.result``."""
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
        """Inverse of ``to_dict``; other keys are left alone."""
        axes, covariance = values["R_1c_axis_angle_deg"], values["R_1c_covariance_rad2"]
        return cls(
            np.array(values["principal_kgm2"]),
            np.array(values["principal_se_kgm2"]),
            None if axes is None else Rotation.from_rotvec(axes, degrees=True).as_matrix(),
            None if covariance is None else np.array(covariance),
        )


def project_positive(inertia: Array) -> tuple[Array, bool]:
    """Footnote 1: replace negative eigenvalues by zero; second result tells whether there were any."""
    values, vectors = np.linalg.eigh(inertia)
    if values[0] >= 0:
        return inertia, False
    return (vectors * np.maximum(values, 0.0)) @ vectors.T, True


def principal_inertia(inertia: Array, covariance: Array) -> PrincipalInertia:
    """Equation (27) with standard errors by first-order perturbation.

    Args:
        inertia: matrix in {b}, axes of {1} [kg m^2], shape (3, 3).
        covariance: of the six parameters of (20) [kg^2 m^4], shape (6, 6).
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
    """Signs of the columns such that they are right-handed and the rotation angle is smallest."""
    choices = [axes * np.array(signs) for signs in ((1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1))]
    choices = [R if np.linalg.det(R) > 0 else -R for R in choices]
    return max(choices, key=np.trace)
