"""Files that say something of a payload: estimates, and the truth beside simulated recordings."""

from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from estimator.arm.unit import seen_by_encoders
from estimator.errors import InputError
from estimator.estimate.result import PayloadEstimate
from estimator.strict import Fields, read_json
from mocobot_sim.scene.as_built import read_units, theta_x_zeros
from mocobot_sim.trial.truth import truth_path
from mocobot_view.facts.body_facts import BodyFacts
from mocobot_view.facts.placement import Grasps

TRUTH = ("grasps", "mass_kg", "p_1c_m", "R_1c_rotvec_deg", "principal_inertia_kgm2")
"""Keys of the truth that are drawn."""


def read_truth(recording: Path, robots: int, estimate: PayloadEstimate | None = None) -> BodyFacts:
    """The truth beside a simulated recording, in the frames of an estimate, if there is one.

    Raises:
        InputError: there is none, or it is not one of as many robots.
    """
    path = truth_path(recording)
    values = read_json(path, "the truth beside a simulated recording")
    truth = Fields(values, TRUTH, str(path), optional=("as_built", "effects", "control"))
    grasps = values["grasps"]
    if not isinstance(grasps, list) or len(grasps) != robots:
        count = len(grasps) if isinstance(grasps, list) else "no"
        raise InputError(f"{path}: has {count} grasps; {recording} is of {robots} robots")
    each = [
        Fields(entry, ("p_1i_m", "R_1i_rotvec_deg"), f"{path}: grasps[{k}]") for k, entry in enumerate(grasps)
    ]
    R_1c, *R_1i = (
        Rotation.from_rotvec(read.array(key, (3,)), degrees=True).as_matrix()
        for read, key in ((truth, "R_1c_rotvec_deg"), *((entry, "R_1i_rotvec_deg") for entry in each))
    )
    p_1i = np.array([entry.array("p_1i_m", (3,)) for entry in each])
    parts = [np.array(R_1i), p_1i, truth.array("p_1c_m", (3,)), R_1c]
    if estimate is not None and estimate.zero_sd_rad and "as_built" in truth:
        parts = seen_by_encoders(theta_x_zeros(read_units(path), robots), *parts)
    R, p, p_1c, R_1c = parts
    moments = truth.array("principal_inertia_kgm2", (3,))
    return BodyFacts(Grasps(R, p), truth.number("mass_kg"), p_1c, R_1c, moments)


def read_estimate(path: Path) -> PayloadEstimate:
    """Read what ``mocobot estimate --out`` wrote.

    Raises:
        InputError: it cannot be read, or is not a whole estimate.
    """
    values = read_json(path, "an estimate")
    try:
        estimate = PayloadEstimate.from_dict(values)
        _check(estimate)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    except (IndexError, OverflowError) as error:  # pairs of robots that are not there, boundless numbers
        raise InputError(f"{path}: not a complete estimate ({type(error).__name__}: {error})") from error
    return estimate


def _check(estimate: PayloadEstimate) -> None:
    """Shapes and finite numbers of what is drawn, which the estimate's own reader takes as they are."""
    facts: list[tuple[str, Any, tuple[int, ...]]] = [("com.p_1c_m", estimate.p_1c, (3,))]
    if type(estimate.robots) is not int or estimate.robots < 1:
        raise InputError(f"robots is {estimate.robots!r:.40}; it must be a whole number of at least 1")
    if estimate.p_1c is not None:
        facts.append(("com.covariance_m2", estimate.p_1c_covariance, (3, 3)))
    if (grasps := estimate.grasps) is not None:
        N = estimate.robots
        facts += [("grasps.R_axis_angle_deg", grasps.R_1i, (N, 3, 3)), ("grasps.p_m", grasps.p_1i, (N, 3))]
        facts += [
            ("grasps.covariance", grasps.covariance, (6 * (N - 1),) * 2),
            ("grasps.angular_residual_radps", grasps.angular_residual_rms, (N, N)),
            ("grasps.linear_residual_mps", grasps.linear_residual_rms, (N, N)),
        ]
    if (mass := estimate.mass) is not None:
        facts += [("mass.m_kg", mass.mass, ()), ("mass.m_se_kg", mass.se, ())]
    if (inertia := estimate.inertia) is not None:
        facts += [
            ("inertia.I_b_kgm2", inertia.inertia, (3, 3)),
            ("inertia.principal_kgm2", inertia.principal.moments, (3,)),
            ("inertia.principal_se_kgm2", inertia.principal.moments_se, (3,)),
            ("inertia.R_1c_axis_angle_deg", inertia.principal.R_1c, (3, 3)),
        ]
    for key, value, shape in facts:
        if value is not None and not _is(value, shape):
            size = " x ".join(map(str, shape)) + " finite numbers" if shape else "a finite number"
            raise InputError(f"{key} must hold {size}")


def _is(value: Any, shape: tuple[int, ...]) -> bool:
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        return False
    return array.shape == shape and bool(np.isfinite(array).all())
