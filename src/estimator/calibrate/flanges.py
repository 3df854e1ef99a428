"""Determine zeros of the last gimbal joints from flanges that are known to be parallel.

A calibration determines frame {i} up to a rotation about its x axis by the encoder zero z_i. R_1i as built is Rx(z_1)
R_1i Rx(z_i)^T, with R_1i in the encoders' frames. If the z axes of all flanges are parallel in the payload's drawing,
each must be parallel to that of {1}. This gives two equations per robot i >= 2 and payload. If the x axes of all
flanges are parallel as well, a common rotation about them remains, and the prior determines it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from estimator.arm.unit import AT, COUNT
from estimator.arrays import Array, inertia_matrix, inertia_parameters
from estimator.calibrate.calibration import CalibratedPayload, Calibration
from estimator.estimate.uncertainty import numerical_jacobian, standard_errors

FLOOR_RAD = 2e-6
"""Error of a flange's direction besides the error of its grasp: compliance of the simulated welds."""
OPEN = 0.5
"""Share of the prior standard deviation above which a zero, or a common rotation, counts as undetermined."""
NOT_PARALLEL_RAD = float(np.deg2rad(0.1))
"""Remaining angle above which flanges are not parallel: ten times the tolerance of a careful workshop."""
BEYOND_CHANCE = 7.0
"""chi2 per degree of freedom above which flange errors inflate the noise; chance exceeds it once in a hundred times.
"""
_X = AT["theta_zero"].stop - 1


@dataclass(frozen=True, eq=False)
class Flanges:
    """Result of the parallel-flange equations.

    Attributes:
        zeros: theta_x zeros, reading minus truth [rad], shape (N,).
        covariance: of the zeros, shape (N, N).
        by_grasps: derivative of the zeros by the grasp errors (d_2, e_2, ...) of all payloads in sequence.
        misfit_rad: largest remaining angle between a flange and that of robot 1 [rad].
    """

    zeros: Array
    covariance: Array
    by_grasps: Array
    misfit_rad: float


def parallel_flanges(payloads: Sequence[CalibratedPayload], sd_rad: float) -> Flanges:
    """Estimate the zeros that make all flanges parallel.

    Args:
        payloads: payloads of a calibration, in the encoders' frames.
        sd_rad: prior standard deviation of a zero [rad].
    """
    N = payloads[0].grasps.robots
    covariance = np.asarray(block_diag(*(payload.grasps.covariance for payload in payloads)))
    sign = [np.where(payload.grasps.R_1i[1:, 2, 2] < 0, -1.0, 1.0) for payload in payloads]

    def slant(zeros: Array, errors: Array | None = None) -> Array:
        """Return components of the flange z axes of robots 2 to N across that of robot 1, shape (P (N - 1) 2,)."""
        out = []
        for k, payload in enumerate(payloads):
            moved = (
                payload.grasps if errors is None else payload.grasps.moved(np.split(errors, len(payloads))[k])
            )
            axes = turned(moved.R_1i, zeros)[1:, :, 2]
            out.append(sign[k][:, None] * axes[:, :2])
        return np.concatenate(out).ravel()

    count = len(covariance)
    # Neglects the small rotation of the noise covariance with the zeros.
    by_grasps = numerical_jacobian(lambda errors: slant(np.zeros(N), errors), np.zeros(count))
    noise = by_grasps @ covariance @ by_grasps.T + FLOOR_RAD**2 * np.eye(len(by_grasps))
    white = np.asarray(np.linalg.inv(np.linalg.cholesky(noise)), dtype=float)
    zeros = least_squares(
        lambda z: np.concatenate([white @ slant(z), z / sd_rad]), np.zeros(N), x_scale=sd_rad, xtol=1e-14
    ).x
    left = slant(zeros)
    J = numerical_jacobian(slant, zeros)
    whitened = white @ J
    spare = max(1, len(left) - N)
    chi2 = float(np.sum((white @ left) ** 2))
    excess = chi2 / spare if chi2 > BEYOND_CHANCE * spare else 1.0  # flanges are not exactly parallel
    information = whitened.T @ whitened / excess + np.eye(N) / sd_rad**2
    posterior = np.asarray(np.linalg.inv(information), dtype=float)
    by_errors = -posterior @ whitened.T @ (white @ by_grasps) / excess
    return Flanges(zeros, posterior, by_errors, float(np.max(np.linalg.norm(left.reshape(-1, 2), axis=1))))


def turned(R_1i: Array, zeros: Array) -> Array:
    """Return R_1i as built, from R_1i in the encoders' frames and theta_x zeros [rad]; shapes (N, 3, 3) and (N,)."""
    about_x = Rotation.from_euler("x", np.asarray(zeros)[:, None]).as_matrix()
    return about_x[0] @ R_1i @ np.swapaxes(about_x, -1, -2)


def in_drawing_frames(calibration: Calibration) -> Calibration:
    """Apply the theta_x zeros that parallel flanges determine: convert a calibration to the drawing's frames.

    The robots' covariance omits correlations between these zeros and all other unknowns; the payloads' covariances
    include them.

    Args:
        calibration: in the encoders' frames, with at least one payload.
    """
    N, payloads = calibration.robots, calibration.payloads
    found = parallel_flanges(payloads, calibration.prior.encoder_zero_rad)
    x = calibration.units.x.copy()
    x[:, _X] = found.zeros
    at = np.arange(N) * COUNT + _X
    covariance = calibration.covariance.copy()
    covariance[np.ix_(at, at)] = found.covariance
    by_scale = calibration.by_scale.copy()
    by_scale[:, _X] = found.by_grasps @ np.concatenate([p.by_scale[: 6 * (N - 1)] for p in payloads])
    return replace(
        calibration,
        units=replace(calibration.units, x=x),
        covariance=covariance,
        by_scale=by_scale,
        payloads=tuple(
            _in_drawing(p, k, len(payloads), found, calibration.prior.encoder_zero_rad)
            for k, p in enumerate(payloads)
        ),
        findings=(*calibration.findings, *_findings(found)),
        open=(*(said for said in calibration.open if "theta_x" not in said), *_open(found, calibration)),
    )


def _in_drawing(
    payload: CalibratedPayload, k: int, payloads: int, found: Flanges, sd_rad: float
) -> CalibratedPayload:
    grasps, count = payload.grasps, 6 * (payload.grasps.robots - 1)
    R_as_built = turned(grasps.R_1i, found.zeros)

    def moved(errors: Array, zeros: Array) -> Array:
        """Return (d_i, e_i, parameters) relative to the result, for errors in the encoders' frames and other zeros."""
        held = grasps.moved(errors[:count])
        first = Rotation.from_euler("x", zeros[0]).as_matrix()
        d = Rotation.from_matrix(turned(held.R_1i, zeros) @ np.swapaxes(R_as_built, -1, -2)).as_rotvec()[1:]
        p = held.p_1i @ first.T
        parameters = payload.parameters + errors[count:]
        J = first @ inertia_matrix(parameters[4:]) @ first.T
        return np.concatenate(
            [
                np.column_stack([d, p[1:]]).ravel(),
                [parameters[0], *(first @ parameters[1:4])],
                inertia_parameters(J),
            ]
        )

    value = moved(np.zeros(count + 10), found.zeros)
    by_errors = numerical_jacobian(lambda errors: moved(errors, found.zeros), np.zeros(count + 10))
    by_zeros = numerical_jacobian(lambda zeros: moved(np.zeros(count + 10), zeros), found.zeros)
    own = np.zeros((len(found.zeros), count + 10))
    own[:, :count] = np.split(found.by_grasps, payloads, axis=1)[k]
    total = by_errors + by_zeros @ own
    # ``total`` already includes errors of the zeros due to this payload's grasps; add the remaining ones.
    rest = found.covariance - own @ payload.covariance @ own.T
    values, axes = np.linalg.eigh(rest)
    covariance = total @ payload.covariance @ total.T
    covariance += by_zeros @ ((axes * np.maximum(values, 0.0)) @ axes.T) @ by_zeros.T
    p_1i = np.concatenate([np.zeros((1, 3)), value[:count].reshape(-1, 6)[:, 3:]])
    return CalibratedPayload(
        payload.label,
        replace(grasps, R_1i=R_as_built, p_1i=p_1i, covariance=covariance[:count, :count]),
        value[count:],
        covariance,
        total @ payload.by_scale,
    )


def _findings(found: Flanges) -> list[str]:
    if found.misfit_rad < NOT_PARALLEL_RAD:
        return []
    return [
        f"Flanges are taken as parallel, and the closest zeros of theta_x leave {np.rad2deg(found.misfit_rad):.2g} deg "
        "between them: they are not parallel, or a gimbal is off in what no zero describes."
    ]


def _open(found: Flanges, calibration: Calibration) -> list[str]:
    share = standard_errors(found.covariance) / calibration.prior.encoder_zero_rad
    if not np.any(share > OPEN):
        return []
    robots = ", ".join(str(i + 1) for i in np.flatnonzero(share > OPEN))
    degrees = np.rad2deg(np.max(standard_errors(found.covariance)))
    return [
        f"Parallel flanges do not decide the zeros of theta_x of robots {robots} (standard error {degrees:.2g} deg): "
        "their x axes are parallel, too, so that a common turn is left; a payload that is held with turned flanges, or "
        "a level at one of them, decides it."
    ]
