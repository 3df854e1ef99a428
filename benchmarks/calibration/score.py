"""Errors of an estimate or a calibration against the truth, and what they are in claimed standard errors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from calibration.truth import Truth, centred, principal
from estimator.arm.unit import AT
from estimator.arrays import Array, inertia_parameters
from estimator.calibrate.calibration import CalibratedPayload, Calibration
from estimator.estimate.grasps import GraspEstimate
from estimator.estimate.result import PayloadEstimate

CENTRED = {"m": slice(0, 1), "com": slice(1, 4), "I": slice(4, 10)}


@dataclass(frozen=True)
class Found:
    """What is scored.

    Attributes:
        grasps: with their covariance.
        centred: (m, p_1c, inertia about the centre of mass), shape (10,).
        covariance: of it, shape (10, 10).
    """

    grasps: GraspEstimate
    centred: Array
    covariance: Array


def of_estimate(estimate: PayloadEstimate) -> Found | None:
    """A staged or joint estimate; its mass, centre of mass and inertia claim no correlation."""
    mass, com, com_covariance, inertia = (
        estimate.mass,
        estimate.p_1c,
        estimate.p_1c_covariance,
        estimate.inertia,
    )
    if estimate.grasps is None or mass is None or com is None or com_covariance is None or inertia is None:
        return None
    covariance = np.zeros((10, 10))
    covariance[0, 0] = mass.se**2
    covariance[1:4, 1:4], covariance[4:, 4:] = com_covariance, inertia.covariance
    return Found(
        estimate.grasps, np.concatenate([[mass.mass], com, inertia_parameters(inertia.inertia)]), covariance
    )


def score(found: Found, truth: Truth, scale: float) -> dict[str, Any]:
    """Largest errors, and normalised ones by group.

    Args:
        found: what came out.
        truth: in the frames that are compared.
        scale: mean spring ratio that the estimate takes to be 0; masses and inertias are compared with the truth over
            1 + scale, too.
    """
    turned, shifted = grasp_errors(found.grasps, truth)
    held = _centred_truth(truth, scale)
    error = found.centred - held
    grasps = np.concatenate([turned, shifted], axis=1).ravel()
    result: dict[str, Any] = {
        "R_deg": float(np.rad2deg(np.linalg.norm(turned, axis=1).max())),
        "p_mm": float(1e3 * np.linalg.norm(shifted, axis=1).max()),
        "com_mm": float(1e3 * np.linalg.norm(error[1:4])),
        "m_percent": 100.0 * abs(error[0]) / held[0],
        "I_percent": _principal_percent(found.centred[4:], held[4:]),
        "m_percent_raw": 100.0 * abs(found.centred[0] / truth.mass - 1.0),
        "I_percent_raw": _principal_percent(found.centred[4:], inertia_parameters(truth.inertia)),
    }
    return result | {
        "claims": {"grasps": claim(grasps, found.grasps.covariance)} | claims(error, found.covariance)
    }


def grasp_errors(grasps: GraspEstimate, truth: Truth) -> tuple[Array, Array]:
    """Rotation vectors [rad] and shifts [m] from the truth to the estimate, both in {1}, shape (N - 1, 3)."""
    turned = Rotation.from_matrix(grasps.R_1i[1:] @ np.swapaxes(truth.R_1i[1:], -1, -2)).as_rotvec()
    return turned, grasps.p_1i[1:] - truth.p_1i[1:]


def claims(error: Array, covariance: Array) -> dict[str, Any]:
    """Of mass, centre of mass and inertia apart."""
    return {name: claim(error[at], covariance[at, at]) for name, at in CENTRED.items()}


def claim(error: Array, covariance: Array) -> dict[str, Any]:
    """Errors in claimed standard errors one by one, and all together (NEES)."""
    sd = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    correlation = covariance / np.outer(sd, sd)
    z = error / sd
    return {
        "z": z.tolist(),
        "nees": float(z @ np.linalg.lstsq(correlation, z, rcond=1e-12)[0]),
        "n": len(error),
    }


def score_calibration(calibration: Calibration, payload: int, truth: Truth) -> dict[str, Any]:
    """A calibration's payload and robots against the truth.

    With the scale held both ways count: as it is held (``claims``) and with its uncertainty (``claims_in_all``).
    """
    one = calibration.payloads[payload]
    scale = 0.0 if calibration.scale_sd == 0.0 else truth.scale
    values = score(found_of(one, one.covariance), truth, scale)
    held = one.parameters - truth.parameters
    shift = one.by_scale * scale
    turned, shifted = grasp_errors(one.grasps, truth)
    error = np.concatenate([np.concatenate([turned, shifted], axis=1).ravel(), held])
    values["claims"] |= {"payload": claim(error + shift, one.covariance)}
    in_all = one.covariance + calibration.scale_sd**2 * np.outer(one.by_scale, one.by_scale)
    whole = found_of(one, in_all)
    values["claims_in_all"] = {"payload": claim(error, in_all)}
    values["claims_in_all"] |= claims(whole.centred - _centred_truth(truth, 0.0), whole.covariance)
    return values | {"units": score_units(calibration, truth)}


def score_units(calibration: Calibration, truth: Truth) -> dict[str, Any]:
    """Errors of the robots: normalised in the coordinates of their prior, and by group with what was claimed."""
    known = calibration.scale_sd == 0.0
    error = calibration.units.x - truth.units
    if not known:
        error = error + calibration.by_scale * truth.scale
    factor = calibration.prior.factor(calibration.robots, hold_scale=not known)
    if not factor.size:
        return {}
    back = np.linalg.pinv(factor)
    variance = np.diag(calibration.covariance).reshape(error.shape)
    groups = {
        name: [float(np.sqrt(np.mean(part[:, at] ** 2))) for part in (error, np.sqrt(variance))]
        for name, at in AT.items()
    }
    return claim(back @ error.ravel(), back @ calibration.covariance @ back.T) | {"groups": groups}


def found_of(one: CalibratedPayload, covariance: Array) -> Found:
    """A calibrated payload with its parameters' covariance taken over to mass, centre of mass and inertia."""
    split = len(covariance) - 10
    J = np.zeros((10, 10))
    steps = 1e-6 * np.maximum(np.abs(one.parameters), 1e-2)
    for k, step in enumerate(steps):
        dx = np.zeros(10)
        dx[k] = step
        J[:, k] = (centred(one.parameters + dx) - centred(one.parameters - dx)) / (2.0 * step)
    return Found(one.grasps, centred(one.parameters), J @ covariance[split:, split:] @ J.T)


def _centred_truth(truth: Truth, scale: float) -> Array:
    over = 1.0 + scale
    return np.concatenate([[truth.mass / over], truth.p_1c, inertia_parameters(truth.inertia) / over])


def _principal_percent(found: Array, true: Array) -> float:
    a, b = principal(found), principal(true)
    return float(100.0 * np.max(np.abs(a / b - 1.0)))
