"""Payload estimates without and with the causes, and their errors if the truth is known."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from estimator.arm.unit import ArmUnit, in_encoder_frames, seen_by_encoders
from estimator.arrays import Array, inertia_matrix
from estimator.estimate.inertia import about_com
from estimator.rigid_team import Shared

Estimate = dict[str, Any]


def to_dict(shared: Shared) -> Estimate:
    """Mass, centre of mass, principal moments and grasps as plain numbers."""
    about_c = about_com(shared.pi)
    return {
        "mass_kg": float(about_c[0]),
        "p_1c_m": about_c[1:4].tolist(),
        "principal_inertia_kgm2": np.linalg.eigvalsh(inertia_matrix(about_c[4:])).tolist(),
        "grasps": [
            {
                "p_1i_m": p.tolist(),
                "R_1i_rotvec_deg": Rotation.from_matrix(R).as_rotvec(degrees=True).tolist(),
            }
            for p, R in zip(shared.grasps.p_1i, shared.grasps.R_1i, strict=True)
        ],
    }


def errors(estimate: Mapping[str, Any], truth: Mapping[str, Any]) -> dict[str, float]:
    """Errors of an estimate against a truth of the same form; of several robots or axes the largest.

    Raises:
        ValueError, KeyError, TypeError: the truth is incomplete, or has another number of robots.
    """
    moments, true_moments = (_three(x, "principal_inertia_kgm2") for x in (estimate, truth))
    turns, places = [0.0], [0.0]
    for mine, true in zip(estimate["grasps"], truth["grasps"], strict=True):
        R, R_true = (Rotation.from_rotvec(_three(x, "R_1i_rotvec_deg"), degrees=True) for x in (mine, true))
        turns.append(float(np.rad2deg((R_true.inv() * R).magnitude())))
        places.append(_apart_mm(mine, true, "p_1i_m"))
    return {
        "mass_percent": 100 * abs(estimate["mass_kg"] / float(truth["mass_kg"]) - 1.0),
        "com_mm": _apart_mm(estimate, truth, "p_1c_m"),
        "principal_inertia_percent": 100 * float(np.max(np.abs(moments / true_moments - 1.0))),
        "grasp_rotation_deg": max(turns),
        "grasp_position_mm": max(places),
    }


def seen_by(units: ArmUnit | None, truth: Mapping[str, Any]) -> Mapping[str, Any]:
    """Express a truth in the frames of an estimate with these robots; raises like ``errors``."""
    if units is None or not in_encoder_frames(units) or not truth.get("as_built"):
        return truth
    zeros = np.array([_three(unit, "theta_zero_rad")[2] for unit in truth["as_built"]])
    places, turns = ([_three(one, key) for one in truth["grasps"]] for key in ("p_1i_m", "R_1i_rotvec_deg"))
    R = Rotation.from_rotvec(turns, degrees=True).as_matrix()
    R, p, p_1c = seen_by_encoders(zeros, R, np.array(places), _three(truth, "p_1c_m"))
    each = zip(p, Rotation.from_matrix(R).as_rotvec(degrees=True), strict=True)
    return {**truth, "p_1c_m": p_1c, "grasps": [{"p_1i_m": p, "R_1i_rotvec_deg": turn} for p, turn in each]}


def _apart_mm(a: Mapping[str, Any], b: Mapping[str, Any], key: str) -> float:
    return 1e3 * float(np.linalg.norm(_three(a, key) - _three(b, key)))


def _three(values: Mapping[str, Any], key: str) -> Array:
    array = np.asarray(values[key], dtype=float)
    if array.shape != (3,) or not np.all(np.isfinite(array)):
        raise ValueError(f"{key} has shape {array.shape}, not (3,), or is not finite")
    return array
