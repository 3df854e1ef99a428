"""JSON form of an estimate: plain types, no NaN, units in the keys; null is what the data do not determine.

format, version            "mocobot-estimate", 1
payload, robots, method    label or null; N; "staged" or "joint"
grasps                     null, or
    pairs                  list over i < j of {i, j, R_axis_angle_deg [3], R_se_deg [3], p_m [3], p_se_m [3],
                           distance_m, distance_se_m, angular_residual_radps, linear_residual_mps}
    covariance             of the frames {2}..{N}, 6(N-1) square, order and units of GraspEstimate
    angular_residual_radps, linear_residual_mps   N x N rms residuals of all pairs
    angular_motion_radps, linear_motion_mps       N rms motions
mass                       null or {m_kg, m_se_kg, residual_N}
com                        null or {p_1c_m [3], p_1c_se_m [3], distance_m, distance_se_m, covariance_m2}
inertia                    null, or
    I_b_kgm2               3 x 3 about the CoM, axes of {1}
    I_b_se_kgm2            3 x 3 standard errors
    covariance_kg2m4       6 x 6 in the order xx, xy, xz, yy, yz, zz
    principal_kgm2, principal_se_kgm2             3, ascending
    R_1c_axis_angle_deg, R_1c_se_deg              3 or null when moments are too alike
    R_1c_covariance_rad2   3 x 3 or null
    projected              true if a negative eigenvalue was set to zero
    residual_Nm, moment_Nm rms moment left and explained
steps                      list of {step, parameters, unit, singular_values, noise, rank, condition,
                           weak: [{direction, vector, reason}]}; condition null if infinite
undetermined               list of {step, direction, vector, reason}: all weak directions again
recordings                 list of {name, trial, duration_s, holds, grasps, inertia, force_residual,
                           moment_residual_m}
flags                      list of sentences

``mocobot estimate`` adds ``provenance``: versions, options and hashes of the recordings (``mocobot.files.provenance``).
Readers ignore it and any other key.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimator import so3
from estimator.errors import InputError
from estimator.estimate.grasp_estimate import GraspEstimate
from estimator.estimate.identifiability import StepReport, WeakDirection
from estimator.estimate.inertia import InertiaEstimate
from estimator.estimate.principal import PrincipalInertia, inertia_matrix
from estimator.estimate.result import PayloadEstimate, RecordingEstimate
from estimator.estimate.statics import MassEstimate
from estimator.estimate.uncertainty import standard_errors

Array = NDArray[np.float64]

FORMAT, VERSION = "mocobot-estimate", 1


def to_dict(estimate: PayloadEstimate) -> dict[str, Any]:
    """The estimate as documented above."""
    com = None
    if estimate.p_1c is not None and estimate.p_1c_covariance is not None:
        com = {
            "p_1c_m": _list(estimate.p_1c),
            "p_1c_se_m": _list(standard_errors(estimate.p_1c_covariance)),
            "distance_m": float(np.linalg.norm(estimate.p_1c)),
            "distance_se_m": estimate.p_1c_distance_se_m,
            "covariance_m2": _list(estimate.p_1c_covariance),
        }
    mass = estimate.mass
    return {
        "format": FORMAT,
        "version": VERSION,
        "payload": estimate.payload,
        "robots": estimate.robots,
        "method": estimate.method,
        "grasps": _grasps_to_dict(estimate.grasps),
        "mass": mass and {"m_kg": mass.mass, "m_se_kg": mass.se, "residual_N": mass.residual_rms},
        "com": com,
        "inertia": _inertia_to_dict(estimate.inertia),
        "steps": [_step_to_dict(step) for step in estimate.steps],
        "undetermined": [{"step": weak.step, **_weak_to_dict(weak)} for weak in estimate.undetermined],
        "recordings": [
            {
                "name": r.name,
                "trial": r.trial,
                "duration_s": r.duration_s,
                "holds": r.holds,
                "grasps": _grasps_to_dict(r.grasps),
                "inertia": _inertia_to_dict(r.inertia),
                "force_residual": r.force_residual,
                "moment_residual_m": r.moment_residual_m,
            }
            for r in estimate.recordings
        ],
        "flags": list(estimate.flags),
    }


def from_dict(values: dict[str, Any]) -> PayloadEstimate:
    """Inverse of ``to_dict``.

    Raises:
        InputError: the mapping is not such an estimate, or of another version.
    """
    if not isinstance(values, dict) or values.get("format") != FORMAT or values.get("version") != VERSION:
        raise InputError(f"not an estimate: it must have format {FORMAT!r} and version {VERSION}")
    try:
        com, mass, robots = values["com"], values["mass"], values["robots"]
        return PayloadEstimate(
            payload=values["payload"],
            robots=robots,
            method=values["method"],
            grasps=_grasps_from_dict(values["grasps"], robots),
            mass=mass and MassEstimate(mass["m_kg"], mass["m_se_kg"], mass["residual_N"]),
            p_1c=None if com is None else np.array(com["p_1c_m"]),
            p_1c_covariance=None if com is None else np.array(com["covariance_m2"]),
            inertia=_inertia_from_dict(values["inertia"]),
            steps=tuple(_step_from_dict(step) for step in values["steps"]),
            recordings=tuple(
                RecordingEstimate(
                    **{k: v for k, v in r.items() if k not in ("grasps", "inertia")},
                    grasps=_grasps_from_dict(r["grasps"], robots),
                    inertia=_inertia_from_dict(r["inertia"]),
                )
                for r in values["recordings"]
            ),
            flags=tuple(values["flags"]),
        )
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(f"not a complete estimate ({type(error).__name__}: {error})") from error


def _grasps_to_dict(grasps: GraspEstimate | None) -> dict[str, Any] | None:
    if grasps is None:
        return None
    pairs = []
    for i in range(1, grasps.robots + 1):
        for j in range(i + 1, grasps.robots + 1):
            pair = grasps.pair(i, j)
            pairs.append(
                {
                    "i": i,
                    "j": j,
                    "R_axis_angle_deg": _list(np.rad2deg(pair.axis_angle_rad)),
                    "R_se_deg": _list(np.rad2deg(pair.axis_angle_se_rad)),
                    "p_m": _list(pair.p_ij),
                    "p_se_m": _list(pair.p_se_m),
                    "distance_m": float(np.linalg.norm(pair.p_ij)),
                    "distance_se_m": pair.distance_se_m,
                    "angular_residual_radps": float(grasps.angular_residual_rms[i - 1, j - 1]),
                    "linear_residual_mps": float(grasps.linear_residual_rms[i - 1, j - 1]),
                }
            )
    return {
        "pairs": pairs,
        "covariance": _list(grasps.covariance),
        "angular_residual_radps": _list(grasps.angular_residual_rms),
        "linear_residual_mps": _list(grasps.linear_residual_rms),
        "angular_motion_radps": _list(grasps.angular_motion_rms),
        "linear_motion_mps": _list(grasps.linear_motion_rms),
    }


def _grasps_from_dict(values: dict[str, Any] | None, robots: int) -> GraspEstimate | None:
    if values is None:
        return None
    R, p = np.tile(np.eye(3), (robots, 1, 1)), np.zeros((robots, 3))
    for pair in values["pairs"]:
        if pair["i"] == 1:
            R[pair["j"] - 1] = so3.exp(np.deg2rad(pair["R_axis_angle_deg"]))
            p[pair["j"] - 1] = pair["p_m"]
    size = 6 * (robots - 1)
    return GraspEstimate(
        R,
        p,
        np.array(values["covariance"], dtype=float).reshape(size, size),
        np.array(values["angular_residual_radps"]),
        np.array(values["linear_residual_mps"]),
        np.array(values["angular_motion_radps"]),
        np.array(values["linear_motion_mps"]),
    )


def _inertia_to_dict(inertia: InertiaEstimate | None) -> dict[str, Any] | None:
    if inertia is None:
        return None
    axes, axes_se = inertia.principal.axis_angle_rad, inertia.principal.axis_angle_se_rad
    covariance = inertia.principal.R_1c_covariance
    return {
        "I_b_kgm2": _list(inertia.inertia),
        "I_b_se_kgm2": _list(inertia_matrix(standard_errors(inertia.covariance))),
        "covariance_kg2m4": _list(inertia.covariance),
        "principal_kgm2": _list(inertia.principal.moments),
        "principal_se_kgm2": _list(inertia.principal.moments_se),
        "R_1c_axis_angle_deg": None if axes is None else _list(np.rad2deg(axes)),
        "R_1c_se_deg": None if axes_se is None else _list(np.rad2deg(axes_se)),
        "R_1c_covariance_rad2": None if covariance is None else _list(covariance),
        "projected": inertia.projected,
        "residual_Nm": inertia.residual_rms,
        "moment_Nm": inertia.moment_rms,
    }


def _inertia_from_dict(values: dict[str, Any] | None) -> InertiaEstimate | None:
    if values is None:
        return None
    axes, covariance = values["R_1c_axis_angle_deg"], values["R_1c_covariance_rad2"]
    principal = PrincipalInertia(
        np.array(values["principal_kgm2"]),
        np.array(values["principal_se_kgm2"]),
        None if axes is None else so3.exp(np.deg2rad(axes)),
        None if covariance is None else np.array(covariance),
    )
    return InertiaEstimate(
        np.array(values["I_b_kgm2"]),
        np.array(values["covariance_kg2m4"]),
        principal,
        values["projected"],
        values["residual_Nm"],
        values["moment_Nm"],
    )


def _step_to_dict(step: StepReport) -> dict[str, Any]:
    return {
        "step": step.step,
        "parameters": list(step.parameters),
        "unit": step.unit,
        "singular_values": list(step.singular_values),
        "noise": step.noise,
        "rank": step.rank,
        "condition": step.condition if np.isfinite(step.condition) else None,
        "weak": [_weak_to_dict(weak) for weak in step.weak],
    }


def _weak_to_dict(weak: WeakDirection) -> dict[str, Any]:
    return {"direction": weak.direction, "vector": list(weak.vector), "reason": weak.reason}


def _step_from_dict(values: dict[str, Any]) -> StepReport:
    weak = tuple(
        WeakDirection(values["step"], w["direction"], tuple(w["vector"]), w["reason"]) for w in values["weak"]
    )
    return StepReport(
        values["step"],
        tuple(values["parameters"]),
        values["unit"],
        tuple(values["singular_values"]),
        values["noise"],
        weak,
    )


def _list(array: Array) -> list[Any]:
    return np.asarray(array, dtype=float).tolist()
