"""The paper's tables as data, and errors of an estimate as the paper defines them (Tables II-V).

Rotation errors are angles of R_ij^T Rhat_ij, and position errors are Euclidean norms. Percentages are relative to the
norm of the true value. Tables II and III give mean and standard deviation of the error norm over the random trials.
Table IV uses one static set and the pooled grasps. Table V gives bias (magnitude of the mean *signed* error) and
scatter (standard deviation of the estimates over trials). Standard deviations divide by n - 1; for one trial they are
null.

The zero of the gimbal's last axis turns the grasp frames that the sensors measure, and no measurement can determine
it. Errors are therefore given in the frames of the CAD model, as in the paper, and in those defined by the encoders.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from estimator.arm.unit import seen_by_encoders
from estimator.arrays import Array
from estimator.calibrate.calibration import CalibratedPayload, carried
from estimator.errors import InputError
from estimator.estimate.grasps import GraspEstimate
from estimator.estimate.result import PayloadEstimate
from estimator.strict import Fields, read_toml
from mocobot_sim.scene.as_built import AsBuilt, theta_x_zeros, units_of
from mocobot_sim.scene.models import RIGID


@dataclass(frozen=True)
class PayloadTruth:
    """True parameters of a payload; frames as in ``PayloadEstimate``."""

    name: str  # name of the payload
    R_1i: Array  # rotations of the grasp frames in {1}, shape (N, 3, 3)
    p_1i: Array  # origins of the grasp frames in {1} [m], shape (N, 3)
    mass: float  # mass [kg]
    p_1c: Array  # centre of mass in {1} [m], shape (3,)
    R_1c: Array  # principal axes in {1}, as columns, shape (3, 3)
    principal_moments: Array  # principal moments of inertia, ascending [kg m^2], shape (3,)

    @property
    def inertia(self) -> Array:
        """Inertia matrix about the centre of mass in the axes of {1} [kg m^2], shape (3, 3)."""
        return self.R_1c @ np.diag(self.principal_moments) @ self.R_1c.T

    def seen_by_encoders(self, theta_x_zero: Array) -> PayloadTruth:
        """Express the truth in the frames defined by the encoders: each {i} turned about its x axis by the zero.

        Args:
            theta_x_zero: reading minus true theta_x of every robot [rad], shape (N,).
        """
        R, p, p_1c, R_1c = seen_by_encoders(theta_x_zero, self.R_1i, self.p_1i, self.p_1c, self.R_1c)
        return replace(self, R_1i=R, p_1i=p, p_1c=p_1c, R_1c=R_1c)

    def T(self, i: int, j: int) -> Array:
        """Homogeneous transform T_ij, shape (4, 4); robots counted from 1."""
        T = np.eye(4)
        T[:3, :3] = self.R_1i[i - 1].T @ self.R_1i[j - 1]
        T[:3, 3] = self.R_1i[i - 1].T @ (self.p_1i[j - 1] - self.p_1i[i - 1])
        return T


PAYLOADS = RIGID
_FILE = Path(__file__).with_name("published.toml")
_TRUTH = (
    "R_12_deg", "R_23_deg", "R_31_deg", "p_12_m", "p_23_m", "p_31_m", "mass_kg", "p_1c_m", "R_1c_deg", "principal_kgm2"
)  # fmt: skip


def payload_truth(name: str) -> PayloadTruth:
    """True parameters of payload ``"a"``, ``"b"``, ``"c"`` or ``"d"`` from Table I.

    T_12 and T_31 are taken as printed; T_23 is computed from them.

    Raises:
        InputError: there is no such payload.
    """
    row = Fields(printed_truth(name), _TRUTH, f"{_FILE.name}: {name}.truth")
    R_12, R_31, R_1c = (
        Rotation.from_rotvec(row.array(key, (3,)), degrees=True).as_matrix()
        for key in ("R_12_deg", "R_31_deg", "R_1c_deg")
    )
    return PayloadTruth(
        name=name,
        R_1i=np.stack([np.eye(3), R_12, R_31.T]),
        p_1i=np.stack([np.zeros(3), row.array("p_12_m", (3,)), -R_31.T @ row.array("p_31_m", (3,))]),
        mass=row.number("mass_kg", above=0.0),
        p_1c=row.array("p_1c_m", (3,)),
        R_1c=R_1c,
        principal_moments=row.array("principal_kgm2", (3,)),
    )


def published_errors(name: str) -> dict[str, Any]:
    """Published errors of a payload (Tables II-V), with the keys of ``score``; inertia only under ``"all"``.

    Raises:
        InputError: there is no such payload.
    """
    return _payload(name)["errors"]


def printed_truth(name: str) -> dict[str, Any]:
    """Values of Table I exactly as printed (degrees, metres), T_23 included.

    Raises:
        InputError: there is no such payload.
    """
    return _payload(name)["truth"]


def _payload(name: str) -> dict[str, Any]:
    tables = _tables()
    if name not in tables:
        raise InputError(f"there is no payload {name!r} in the paper; it has {', '.join(sorted(tables))}")
    return tables[name]


@cache
def _tables() -> dict[str, Any]:
    return read_toml(_FILE, "file of the paper's tables")


MOMENTS = ("Ixx", "Iyy", "Izz")


ENCODER_FRAMES = "encoder_frames"
"""Key of the errors of grasps and centre of mass in the frames defined by the encoders."""
SPRING_SCALE = "spring_scale"
"""Key of the relative error due to the common stiffness scale of a team's springs, and of the errors beyond it."""


@dataclass(frozen=True)
class TrialSummary:
    """Largest payload rotation, SEA torque, rod and weld gaps and weld angle of one trial, and its damping ratio.

    The damping ratio of the control is below 0 if the control was unstable, and None if it is unknown.
    """

    name: str
    rotation_deg: float
    torque_Nm: float
    rod_error_m: float
    weld_error_m: float
    weld_error_deg: float
    damping_ratio: float | None


def score(
    estimate: PayloadEstimate, truth: PayloadTruth, units: Sequence[AsBuilt] | None = None
) -> dict[str, Any]:
    """Compute the errors of one payload's staged estimate; None where the estimate has no value.

    Grasps are scored on random trials, inertia on random and periodic trials. The paper uses six random trials for the
    grasps, but three trials of each kind for the inertia. Therefore ``"random"`` uses only the first random trials, as
    many as there are periodic ones (all if there is none). ``"all"`` pools these and the periodic trials.

    Args:
        estimate: estimate of the payload.
        truth: true parameters in the frames of the CAD model.
        units: deviations of the robots, empty for robots as designed; None omits ``"encoder_frames"``.

    Returns:
        ``{"R12_deg": {"mean", "std"}, "p12_m": {"mean", "std"}, "p12_percent": {"mean", "std"}, (23, 31),
        "m_kg", "m_percent", "p1c_m", "p1c_percent", "all": {"Ixx": {"mean", "std", "percent",
        "std_percent"}, "Iyy", "Izz"}, "random": {the same}, "periodic": {the same}, "encoder_frames": {R, p and
        p1c once more}}``.
        For other than three robots the pairs are (1, 2), (2, 3), ..., and (N, 1) when N > 2.
    """
    random = [r for r in estimate.recordings if r.trial == "random"]
    periodic = [r for r in estimate.recordings if r.trial == "periodic"]
    grasps = [r.grasps for r in random if r.grasps is not None]
    result = _grasp_errors(grasps, truth)
    result |= _mass_errors(None if estimate.mass is None else estimate.mass.mass, truth)
    result |= _com_errors(estimate.p_1c, truth)
    moments = {
        kind: [r.inertia.principal.moments for r in group if r.inertia is not None]
        for kind, group in (("random", random), ("periodic", periodic))
    }
    if moments["random"] and moments["periodic"]:
        moments["random"] = moments["random"][: len(moments["periodic"])]
    result["all"] = _moment_errors(moments["random"] + moments["periodic"], truth)
    result["random"] = _moment_errors(moments["random"], truth)
    result["periodic"] = _moment_errors(moments["periodic"], truth)
    if units is not None:
        seen = truth.seen_by_encoders(theta_x_zeros(units, len(truth.p_1i)))
        result[ENCODER_FRAMES] = _grasp_errors(grasps, seen) | _com_errors(estimate.p_1c, seen)
    return result


def score_fit(found: CalibratedPayload, truth: PayloadTruth, units: Sequence[AsBuilt]) -> dict[str, Any]:
    """Compute the errors of a payload from one joint fit; each mean has one value and no standard deviation.

    Trials with a payload do not determine the common stiffness scale of all springs. Fitted masses and inertias are
    therefore truth / (1 + mean stiffness ratio of the team). ``"spring_scale"`` gives this relative error and the
    errors that remain beyond it.

    Args:
        found: fitted payload.
        truth: true parameters in the frames of the CAD model.
        units: deviations of the robots, empty for robots as designed.

    Returns:
        The keys of ``score`` except ``"random"`` and ``"periodic"``, and ``"spring_scale"``: ``{"percent",
        "m_percent", "Ixx_percent", "Iyy_percent", "Izz_percent"}``. Only the first has a sign.
    """
    numbers = carried(found, 0.0)
    mass, p_1c, moments = numbers.mass_kg, numbers.p_1c, numbers.principal.moments
    seen = truth.seen_by_encoders(theta_x_zeros(units, len(truth.p_1i)))
    built = units_of(units, len(truth.p_1i))
    share = 1.0 / (1.0 + float(np.mean([unit.stiffness_ratio for unit in built])))
    beyond = {"m": mass / (share * truth.mass)}
    beyond |= dict(zip(MOMENTS, moments / (share * truth.principal_moments), strict=True))
    result = _grasp_errors([found.grasps], truth) | _mass_errors(mass, truth) | _com_errors(p_1c, truth)
    return result | {
        "all": _moment_errors([moments], truth),
        ENCODER_FRAMES: _grasp_errors([found.grasps], seen) | _com_errors(p_1c, seen),
        SPRING_SCALE: {"percent": 100.0 * (share - 1.0)}
        | {f"{name}_percent": 100.0 * abs(float(ratio) - 1.0) for name, ratio in beyond.items()},
    }


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


def _mass_errors(mass: float | None, truth: PayloadTruth) -> dict[str, float | None]:
    m = None if mass is None else abs(mass - truth.mass)
    return {"m_kg": m, "m_percent": _percent(m, truth.mass)}


def _com_errors(p_1c: Array | None, truth: PayloadTruth) -> dict[str, float | None]:
    p = None if p_1c is None else float(np.linalg.norm(p_1c - truth.p_1c))
    return {"p1c_m": p, "p1c_percent": _percent(p, float(np.linalg.norm(truth.p_1c)))}


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
