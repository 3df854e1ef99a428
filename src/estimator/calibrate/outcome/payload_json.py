"""A calibration's payload as plain JSON values; the keys are documented in ``estimator.calibrate.json``."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from estimator.calibrate.calibration import CalibratedPayload
from estimator.calibrate.outcome.carried import carried, grasps_of
from estimator.calibrate.outcome.robot_list import by_robot
from estimator.estimate.grasp_estimate import GraspEstimate
from estimator.strict import Fields

KEYS = ("label", "grasps", "parameters", "covariance", "by_scale")
DERIVED = (
    "m_kg", "m_se_kg", "p_1c_m", "p_1c_se_m", "I_b_kgm2", "I_b_se_kgm2", "principal_kgm2", "principal_se_kgm2",
)  # fmt: skip
GRASP, PARAMETERS = ("i", "R_axis_angle_deg", "p_m"), ("m_kg", "mp_1c_kgm", "J_1_kgm2")


def payload_to_dict(payload: CalibratedPayload, scale_sd: float) -> dict[str, Any]:
    """Plain values of a payload; standard errors include that of a held spring scale."""
    grasps, whole, about = grasps_of(payload, scale_sd), carried(payload, scale_sd), payload.parameters
    pairs = [grasps.pair(1, j) for j in range(2, grasps.robots + 1)]
    return {
        "label": payload.label,
        "grasps": [
            {
                "i": pair.j,
                "R_axis_angle_deg": np.rad2deg(pair.axis_angle_rad).tolist(),
                "R_se_deg": np.rad2deg(pair.axis_angle_se_rad).tolist(),
                "p_m": pair.p_ij.tolist(),
                "p_se_m": pair.p_se_m.tolist(),
            }
            for pair in pairs
        ],
        "m_kg": whole.mass_kg,
        "m_se_kg": whole.mass_se_kg,
        "p_1c_m": whole.p_1c.tolist(),
        "p_1c_se_m": whole.p_1c_se_m.tolist(),
        "I_b_kgm2": whole.inertia.tolist(),
        "I_b_se_kgm2": whole.inertia_se.tolist(),
        "principal_kgm2": whole.principal.moments.tolist(),
        "principal_se_kgm2": whole.principal.moments_se.tolist(),
        "parameters": {
            "m_kg": float(about[0]),
            "mp_1c_kgm": about[1:4].tolist(),
            "J_1_kgm2": about[4:].tolist(),
        },
        "covariance": payload.covariance.tolist(),
        "by_scale": payload.by_scale.tolist(),
    }


def payload_from_dict(entry: Any, N: int, where: str) -> CalibratedPayload:
    """Inverse of ``payload_to_dict``, for N robots; ``where`` is how messages call it.

    Raises:
        InputError: something is missing or not allowed.
    """
    read = Fields(entry, KEYS, where, DERIVED)
    label = None if read.values["label"] is None else read.words("label")
    R, p, count = np.tile(np.eye(3), (N, 1, 1)), np.zeros((N, 3)), 6 * (N - 1)
    for i, one in enumerate(by_robot(read, "grasps", N, GRASP, ("R_se_deg", "p_se_m")), 1):
        R[i] = Rotation.from_rotvec(one.array("R_axis_angle_deg", (3,)), degrees=True).as_matrix()
        p[i] = one.array("p_m", (3,))
    inner = read.within("parameters", PARAMETERS)
    parameters = np.concatenate(
        [[inner.number("m_kg", above=0.0)], inner.array("mp_1c_kgm", (3,)), inner.array("J_1_kgm2", (6,))]
    )
    covariance = read.array("covariance", (count + 10, count + 10))
    pairs, each = np.full((N, N), np.nan), np.full(N, np.nan)  # a calibration has no residuals of twists
    grasps = GraspEstimate(R, p, covariance[:count, :count], pairs, pairs, each, each)
    return CalibratedPayload(label, grasps, parameters, covariance, read.array("by_scale", (count + 10,)))
