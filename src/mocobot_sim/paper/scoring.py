"""Errors of an estimate as the paper defines them (Tables II-V).

Rotation errors are the angle of R_ij^T Rhat_ij, position errors Euclidean norms, percentages relative to the
norm of the truth. Tables II and III: mean and standard deviation, over the random trials, of each trial's own
error norm. Table IV: one static set, with the grasps pooled. Table V: magnitude of the mean *signed* error
and standard deviation of the estimates over trials, so the two say bias and scatter. Standard deviations
divide by n - 1; one trial has none (null).
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from estimator.arrays import Array
from estimator.estimate.grasp_estimate import GraspEstimate
from estimator.estimate.result import PayloadEstimate
from mocobot_sim.paper.published import PayloadTruth

MOMENTS = ("Ixx", "Iyy", "Izz")


def score(estimate: PayloadEstimate, truth: PayloadTruth) -> dict[str, Any]:
    """Errors of one payload's estimate; null where the estimate has no value.

    Grasps are scored on each recording with trial ``"random"``, inertia on ``"random"`` and ``"periodic"``
    ones. The paper takes three trials of each kind for the inertia but six random ones for the grasps:
    ``"all"`` therefore pools the periodic recordings with as many of the first random ones (with all of
    either kind if the other has none), and ``"random"`` is that same selection.

    Returns:
        ``{"R12_deg": {"mean", "std"}, "p12_m": {"mean", "std"}, "p12_percent": {"mean", "std"}, (23, 31),
        "m_kg", "m_percent", "p1c_m", "p1c_percent", "all": {"Ixx": {"mean", "std", "percent",
        "std_percent"}, "Iyy", "Izz"}, "random": {the same}, "periodic": {the same}}``.
        For other than three robots the pairs are (1, 2), (2, 3), ..., and (N, 1) when N > 2.
    """
    random = [r for r in estimate.recordings if r.trial == "random"]
    periodic = [r for r in estimate.recordings if r.trial == "periodic"]
    result = _grasp_errors([r.grasps for r in random if r.grasps is not None], truth)
    result |= _static_errors(estimate, truth)
    moments = {
        kind: [r.inertia.principal.moments for r in group if r.inertia is not None]
        for kind, group in (("random", random), ("periodic", periodic))
    }
    if moments["random"] and moments["periodic"]:
        moments["random"] = moments["random"][: len(moments["periodic"])]
    result["all"] = _moment_errors(moments["random"] + moments["periodic"], truth)
    result["random"] = _moment_errors(moments["random"], truth)
    result["periodic"] = _moment_errors(moments["periodic"], truth)
    return result


def rotation_error_deg(R: Array, R_estimated: Array) -> float:
    """Angle of R^T R_estimated [deg], shapes (3, 3)."""
    return float(np.rad2deg(Rotation.from_matrix(R.T @ R_estimated).magnitude()))


def _grasp_errors(grasps: Sequence[GraspEstimate], truth: PayloadTruth) -> dict[str, Any]:
    N = len(truth.p_1i)
    pairs = [(i, i + 1) for i in range(1, N)] + ([(N, 1)] if N > 2 else [])
    result: dict[str, Any] = {}
    for i, j in pairs:
        T = truth.T(i, j)
        estimates = [grasp.T(i, j) for grasp in grasps]
        errors = [float(np.linalg.norm(E[:3, 3] - T[:3, 3])) for E in estimates]
        length = float(np.linalg.norm(T[:3, 3]))
        result[f"R{i}{j}_deg"] = _mean_std([rotation_error_deg(T[:3, :3], E[:3, :3]) for E in estimates])
        result[f"p{i}{j}_m"] = _mean_std(errors)
        result[f"p{i}{j}_percent"] = _mean_std([100 * error / length for error in errors])
    return result


def _static_errors(estimate: PayloadEstimate, truth: PayloadTruth) -> dict[str, float | None]:
    m = None if estimate.mass is None else abs(estimate.mass.mass - truth.mass)
    p = None if estimate.p_1c is None else float(np.linalg.norm(estimate.p_1c - truth.p_1c))
    return {
        "m_kg": m,
        "m_percent": _percent(m, truth.mass),
        "p1c_m": p,
        "p1c_percent": _percent(p, float(np.linalg.norm(truth.p_1c))),
    }


def _percent(error: float | None, of: float) -> float | None:
    return None if error is None else 100 * error / of


def _moment_errors(estimates: Sequence[Array], truth: PayloadTruth) -> dict[str, dict[str, float | None]]:
    result = {}
    for k, name in enumerate(MOMENTS):
        true = float(truth.principal_moments[k])
        stats = _mean_std([float(moments[k]) - true for moments in estimates])
        mean = None if stats["mean"] is None else abs(stats["mean"])
        result[name] = {
            "mean": mean,
            "std": stats["std"],
            "percent": _percent(mean, true),
            "std_percent": _percent(stats["std"], true),
        }
    return result


def _mean_std(values: Sequence[float]) -> dict[str, float | None]:
    return {
        "mean": float(np.mean(values)) if len(values) else None,
        "std": float(np.std(values, ddof=1)) if len(values) > 1 else None,
    }
