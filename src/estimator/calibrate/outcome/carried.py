"""A payload's numbers about its centre of mass, with standard errors, from the parameters that a calibration finds."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from estimator.arrays import Array
from estimator.calibrate.calibration import CalibratedPayload
from estimator.estimate.grasp_estimate import GraspEstimate
from estimator.estimate.principal import (
    PrincipalInertia,
    inertia_matrix,
    inertia_parameters,
    principal_inertia,
)
from estimator.estimate.uncertainty import numerical_jacobian, standard_errors


@dataclass(frozen=True, eq=False)
class Carried:
    """A payload's mass, centre of mass and inertia; errors include that of a held spring scale.

    Attributes:
        mass_kg, mass_se_kg: mass.
        p_1c: centre of mass in {1} [m], shape (3,).
        inertia: about it, axes of {1} [kg m^2], shape (3, 3).
        covariance: of the mass, p_1c and xx, xy, xz, yy, yz, zz of the inertia, shape (10, 10).
        by_scale: derivative of the same by the common spring scale, shape (10,).
        principal: principal moments and axes.
    """

    mass_kg: float
    p_1c: Array
    inertia: Array
    covariance: Array
    by_scale: Array
    principal: PrincipalInertia

    @property
    def mass_se_kg(self) -> float:
        """See above."""
        return float(np.sqrt(self.covariance[0, 0]))

    @property
    def p_1c_se_m(self) -> Array:
        """Standard errors of the centre of mass [m], shape (3,)."""
        return standard_errors(self.covariance[1:4, 1:4])

    @property
    def inertia_se(self) -> Array:
        """Standard errors of the inertia [kg m^2], shape (3, 3)."""
        return inertia_matrix(standard_errors(self.covariance[4:, 4:]))


def grasps_of(payload: CalibratedPayload, scale_sd: float) -> GraspEstimate:
    """A payload's grasps with the error of a held spring scale in their covariance."""
    by_scale = payload.by_scale[:-10]
    covariance = payload.covariance[:-10, :-10] + scale_sd**2 * np.outer(by_scale, by_scale)
    return replace(payload.grasps, covariance=covariance)


def carried(payload: CalibratedPayload, scale_sd: float) -> Carried:
    """Numbers about the centre of mass.

    Args:
        payload: one of a calibration's.
        scale_sd: standard deviation of the common spring scale, ``Calibration.scale_sd``.
    """
    at = payload.parameters
    values = _about_com(at)
    step = np.maximum(np.abs(at), 1e-3)  # parameters of different units
    J = numerical_jacobian(lambda x: _about_com(at + step * x), np.zeros(10)) / step
    by_scale = J @ payload.by_scale[-10:]
    covariance = J @ payload.covariance[-10:, -10:] @ J.T + scale_sd**2 * np.outer(by_scale, by_scale)
    inertia = inertia_matrix(values[4:])
    principal = principal_inertia(inertia, covariance[4:, 4:])
    return Carried(float(values[0]), values[1:4], inertia, covariance, by_scale, principal)


def _about_com(parameters: Array) -> Array:
    """(m, p_1c, inertia about the centre of mass) of (m, m p_1c, inertia about {1}), shape (10,)."""
    m = parameters[0]
    c = parameters[1:4] / m
    inertia = inertia_matrix(parameters[4:]) - m * (c @ c * np.eye(3) - np.outer(c, c))
    return np.concatenate([[m], c, inertia_parameters(inertia)])
