"""Estimate mass and centre of mass from static holds (paper, section III-C).

Mass, (9), (11)-(13): the bases are level, so the vertical force sum needs only each robot's own gimbal and no grasp
frame. Centre of mass, (10), (14)-(17): M = m g p_1c x up, with M the moment sum about {1}. It has components across
gravity only, so at least two tilts are needed.

A hold has two kinds of errors. The first is the noise of its mean, estimated from batch means. The second differs
between holds but is constant within one (torque rounding, friction, geometry). Its variance is estimated from the
residuals between holds and added to every hold. This is a random-effects model with one scale for forces and one for
moments. It assumes equal, independent errors in every robot's force, and moments follow through the grasps' levers.
The variance is at least the rounding variance of a mean torque (``Hold.rounding_N2``), which does not average out if
noise is below a step.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag, eigh, null_space
from scipy.optimize import brentq

from estimator import so3
from estimator.arrays import Array
from estimator.errors import InputError
from estimator.estimate.grasps import GraspEstimate
from estimator.estimate.uncertainty import StepReport, cross_information, judge, numerical_jacobian
from estimator.rigid_team import fused_up, tilt_scatter, total_wrench
from estimator.signals import Hold
from estimator.statistics import rms

CONTRADICTION = "the wrenches contradict each other"
CONTRADICTION_M = 0.02
"""Residual moment over weight [m] above which noise and poor calibration do not explain it."""


@dataclass(frozen=True)
class MassEstimate:
    """Mass [kg], its standard error [kg], and the rms of the vertical force balance over the holds [N]."""

    mass: float
    se: float
    residual_rms: float


@dataclass(frozen=True)
class ComEstimate:
    """Mass [kg] and centre of mass in {1} [m] from the holds, with their joint covariance.

    Attributes:
        covariance: of (m [kg], p_1c [m]), including grasp errors, shape (4, 4).
        own_covariance: the same without grasp errors.
        grasp_jacobian: derivative of p_1c by the grasp errors of ``GraspEstimate``, shape (3, 6(N-1)).
        residual_rms: rms per component of the moment balance about {1} over the holds [N m].
    """

    mass: float
    p_1c: Array
    covariance: Array
    own_covariance: Array
    grasp_jacobian: Array
    residual_rms: float


def estimate_mass(holds: Sequence[Hold], gravity_mps2: float) -> MassEstimate:
    """Estimate the mass by (13), from one or more holds of any N >= 1 robots.

    Raises:
        InputError: the robots do not carry anything (the mass is zero or negative).
    """
    vertical = np.array([vertical_force(hold.R_bi, hold.wrench[None])[0] for hold in holds])  # (H,)
    mass = float(vertical.mean() / gravity_mps2)
    check_lifted(mass)
    within = [_mean_covariance(vertical_force(hold.R_bi, hold.batches)[:, None]) for hold in holds]
    residual = vertical - vertical.mean()
    dof = len(holds) - 1
    between = max(0.0, residual @ residual / dof - float(np.mean(within))) if dof else 0.0
    se = np.sqrt(np.mean(within) + between) / np.sqrt(len(holds)) / gravity_mps2
    return MassEstimate(mass, max(float(se), rounding_kg(holds, gravity_mps2)), rms(residual))


def rounding_kg(holds: Sequence[Hold], gravity_mps2: float) -> float:
    """Return the standard error of the mass due to rounding in the holds, 0 without holds [kg]."""
    variances = [hold.robots * hold.rounding_N2 for hold in holds]
    return float(np.sqrt(sum(variances))) / max(1, len(holds)) / gravity_mps2


def estimate_com(
    holds: Sequence[Hold], mass: MassEstimate, grasps: GraspEstimate, gravity_mps2: float
) -> tuple[ComEstimate | None, StepReport]:
    """Estimate the centre of mass by (17); None if the tilts of the holds do not differ enough."""
    up, moment = _loads(holds, grasps)
    p_1c, A = _solve(up, moment, mass.mass, gravity_mps2)
    residual = moment - (A @ p_1c).reshape(-1, 3)
    dof = 3 * len(holds) - 3
    rss = float(residual.ravel() @ residual.ravel())
    within = [_mean_covariance(_signals(hold, grasps)) for hold in holds]  # (4, 4): vertical, moment
    # Few holds give few residuals, so also use the noise within them.
    within_rms = float(np.sqrt(np.mean([np.trace(S[1:, 1:]) / 3 for S in within])))
    noise = max(float(np.sqrt(rss / dof)) if dof else 0.0, within_rms)
    weight = mass.mass * gravity_mps2
    report = judge_com(
        cross_information(up), noise, weight, _tilt_noise(holds, grasps),
        "the holds hardly differ in tilt about any axis across it",
    )  # fmt: skip
    if not report.determined:
        return None, report

    def com(x: Array) -> Array:
        return _solve(*_loads(holds, grasps.moved(x)), mass.mass, gravity_mps2)[0]

    def residuals(x: Array) -> Array:
        up_x, moment_x = _loads(holds, grasps.moved(x))
        p_x, A_x = _solve(up_x, moment_x, mass.mass, gravity_mps2)
        return moment_x.ravel() - A_x @ p_x

    # x -> (m, p): each hold contributes errors of its vertical force and of its moment.
    H, K = len(holds), np.linalg.pinv(A).reshape(3, len(holds), 3)
    shapes = [_force_error_shape(up_q, grasps) for up_q in up]
    J_residual = numerical_jacobian(residuals, np.zeros(len(grasps.covariance)))
    known = np.asarray(block_diag(*[S[1:, 1:] for S in within]), dtype=float)
    known += J_residual @ grasps.covariance @ J_residual.T
    shape = np.asarray(block_diag(*[S[1:, 1:] for S in shapes]), dtype=float)
    rounding = float(np.mean([hold.rounding_N2 for hold in holds]))
    between = np.sqrt(max(_excess_variance(residual.ravel(), A, known, shape), rounding))
    vertical_within = float(np.mean([S[0, 0] for S in within]))
    between_force = np.sqrt(max(0.0, (mass.se * gravity_mps2) ** 2 * H - vertical_within) / grasps.robots)
    scale = np.diag([between_force, between, between, between])
    covariance = np.zeros((4, 4))
    for q in range(H):
        S = within[q] + scale @ shapes[q] @ scale
        L = np.zeros((4, 4))
        L[0, 0] = 1 / (H * gravity_mps2)
        L[1:, 0] = -p_1c / (mass.mass * H * gravity_mps2)  # p scales with 1 / m
        L[1:, 1:] = K[:, q]
        covariance += L @ S @ L.T

    J = numerical_jacobian(com, np.zeros(len(grasps.covariance)))
    total = covariance.copy()
    total[1:, 1:] += J @ grasps.covariance @ J.T
    return ComEstimate(mass.mass, p_1c, total, covariance, J, rms(residual)), report


def estimate_from_holds(
    holds: Sequence[Hold], grasps: GraspEstimate | None, gravity_mps2: float
) -> tuple[MassEstimate | None, ComEstimate | None, StepReport | None]:
    """Estimate mass and centre of mass, as far as holds and grasps allow.

    Raises:
        InputError: the robots do not carry anything.
    """
    if not holds:
        return None, None, None
    mass = estimate_mass(holds, gravity_mps2)
    if grasps is None:
        return mass, None, None
    return mass, *estimate_com(holds, mass, grasps, gravity_mps2)


def check_lifted(mass: float) -> None:
    """Refuse a zero or negative mass [kg].

    Raises:
        InputError: the mass is zero or negative.
    """
    if mass <= 0:
        raise InputError(
            f"the estimated mass is {mass:.3g} kg: the robots do not lift anything; "
            "check the sign of the torques"
        )


def judge_com(
    information: Array, moment_rms: float, weight: float, tilt_noise: float, reason: str
) -> StepReport:
    """Judge the excitation of the centre of mass by angles: moment residual over weight at 1 m, and tilt noise.

    Args:
        information: of the directions against gravity, from ``cross_information``, shape (3, 3).
        moment_rms: rms residual moment [N m].
        weight: weight of the payload [N].
        tilt_noise: uncertainty of the tilt [rad].
        reason: reason for an undetermined direction, unless the moments contradict each other.
    """
    if moment_rms >= CONTRADICTION_M * weight:
        reason = (
            f"{CONTRADICTION} ({moment_rms:.2g} N m rms are left over); "
            "check the signs and columns of the torques"
        )
    noise = max(moment_rms / weight, tilt_noise)
    return judge(
        "centre of mass p_1c", ("x", "y", "z"), information, noise,
        unit="rad", words="along", frame="{1}", floor=1e-9, reason=reason,
    )  # fmt: skip


def vertical_force(R_bi: Array, wrench: Array) -> Array:
    """Return the sum over robots of the vertical force [N], from R_bi (N, 3, 3) and wrenches (Q, N, 6), shape (Q,)."""
    return np.einsum("ib,qib->q", R_bi[:, 2], wrench[..., 3:])


def _loads(holds: Sequence[Hold], grasps: GraspEstimate) -> tuple[Array, Array]:
    """Return the direction against gravity and the moment sum about {1}, both in {1}, shape (H, 3)."""
    up = fused_up(np.array([hold.R_bi for hold in holds]), grasps)
    return up, total_wrench(np.array([hold.wrench for hold in holds]), grasps)[1]


def _solve(up: Array, moment: Array, mass: float, gravity: float) -> tuple[Array, Array]:
    A = -mass * gravity * so3.skew(up).reshape(-1, 3)
    return np.asarray(np.linalg.lstsq(A, moment.ravel(), rcond=None)[0], dtype=float), A


def _signals(hold: Hold, grasps: GraspEstimate) -> Array:
    """Return vertical force and moment about {1} of every batch of a hold, shape (batches, 4)."""
    return np.column_stack([vertical_force(hold.R_bi, hold.batches), total_wrench(hold.batches, grasps)[1]])


def _force_error_shape(up: Array, grasps: GraspEstimate) -> Array:
    """Return the covariance of (vertical force, moment about {1}) for unit force errors of all robots, shape (4, 4)."""
    L = [np.vstack([up, so3.skew(p)]) for p in grasps.p_1i]
    shape = np.sum([L_i @ L_i.T for L_i in L], axis=0)
    if np.trace(shape[1:, 1:]) < 1e-6:  # all grasps at {1}: only errors of the moments themselves are left
        shape = np.diag([float(grasps.robots), 1.0, 1.0, 1.0])
    return shape


def _excess_variance(residual: Array, A: Array, known: Array, shape: Array) -> float:
    """Return v >= 0 such that the covariance ``known + v * shape`` explains the residual (Mandel and Paule).

    v solves z^T (known + v shape)^-1 z = dof, with z the part of the residual orthogonal to the columns of A.
    ``known`` includes grasp errors, so that their effect does not count again as scatter between holds.
    """
    U = null_space(A.T)
    z, V_0, V_1 = U.T @ residual, U.T @ known @ U, U.T @ shape @ U
    V_1 = V_1 + 1e-6 * np.trace(V_1) / len(V_1) * np.eye(
        len(V_1)
    )  # with two grasps, one direction has no error

    eigenvalues, axes = eigh(V_0, V_1)
    eigenvalues, squares = np.maximum(eigenvalues, 0.0), (axes.T @ z) ** 2

    def excess(v: float) -> float:
        return float(np.sum(squares / (eigenvalues + v))) - len(z)

    most = float(np.sum(squares)) / len(z)  # the solution if ``known`` were zero
    least = 1e-9 * most
    if most <= 0 or excess(least) <= 0:
        return 0.0
    if excess(most) >= 0:
        return most
    return float(np.asarray(brentq(excess, least, most)))


def _mean_covariance(batches: Array) -> Array:
    """Return the covariance of the mean of independent batches (B, K), shape (K, K)."""
    centred = batches - batches.mean(axis=0)
    return centred.T @ centred / (len(batches) * (len(batches) - 1))


def _tilt_noise(holds: Sequence[Hold], grasps: GraspEstimate) -> float:
    """Return the disagreement of the robots' tilts between holds [rad]; a constant offset is not noise."""
    if grasps.robots == 1 or len(holds) < 2:
        return 0.0
    dof = (len(holds) - 1) * (grasps.robots - 1) * 2  # a direction has two components
    return float(np.sqrt(tilt_scatter(np.array([hold.R_bi for hold in holds]), grasps) / dof))
