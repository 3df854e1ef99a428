"""One motion of the payload from all robots' twists, given the grasp frames, and how it changes with these."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from estimator import so3
from estimator.arrays import Array
from estimator.estimate.grasp_estimate import GraspEstimate
from estimator.signals.grasp_data import GraspData


@dataclass(frozen=True)
class BodyMotion:
    """Motion of the payload and the load on it, in {1}; Q samples.

    Attributes:
        omega, alpha: angular velocity [rad/s] and acceleration [rad/s^2], shape (Q, 3).
        acceleration: acceleration of the origin of {1} (v-dot + omega x v) [m/s^2], shape (Q, 3).
        up: unit vector against gravity, shape (Q, 3).
        force, moment: sum of the robots' wrenches at the origin of {1} [N, N m], shape (Q, 3).
    """

    omega: Array
    alpha: Array
    acceleration: Array
    up: Array
    force: Array
    moment: Array


def fuse(data: GraspData, grasps: GraspEstimate) -> BodyMotion:
    """Combine all robots' measurements in {1}.

    The twist is the weighted least-squares solution of V_i = Ad(T_i1) V_1 over i, angular and linear parts
    weighted by the robots' disagreement. The adjoints are constant, so the same matrix serves V and dV/dt.
    """
    G = fusion_matrix(grasps)
    V = data.twist.reshape(data.samples, -1) @ G.T
    V_dot = data.twist_dot.reshape(data.samples, -1) @ G.T
    omega, v = V[:, :3], V[:, 3:]
    force, moment = total_wrench(data.wrench, grasps)
    return BodyMotion(
        omega=omega,
        alpha=V_dot[:, :3],
        acceleration=V_dot[:, 3:] + np.cross(omega, v),
        up=fused_up(data.R_bi, grasps),
        force=force,
        moment=moment,
    )


class FusionChanges(NamedTuple):
    """Derivatives of a motion by the grasps' errors (``GraspEstimate.covariance``), K = 6(N-1) of them.

    Attributes:
        twist, twist_dot: of the payload's twist in {1} and its component-wise derivative, shape (K, Q, 6).
        up: of the unit vector against gravity in {1}, shape (K, Q, 3).
        force, moment: of the sum of the robots' wrenches at the origin of {1}, shape (K, Q, 3).
    """

    twist: Array
    twist_dot: Array
    up: Array
    force: Array
    moment: Array


def fusion_changes(
    twist: Array,
    twist_dot: Array,
    R_bi: Array,
    wrench: Array,
    grasps: GraspEstimate,
    ratio: float | None = None,
) -> FusionChanges:
    """Derivatives of ``fuse``.

    Args:
        twist, twist_dot, R_bi, wrench: as of ``GraspData``.
        grasps: the grasp frames.
        ratio: a fixed weight as of ``fusion_with``; None for that of ``fusion_matrix``, which changes with them.
    """
    Q, N = twist.shape[:2]
    K = 6 * (N - 1)
    by_ratio = np.zeros(K)
    if ratio is None:
        ratio, by_ratio = _ratio(grasps)
    dG = _fusion_matrix_changes(grasps, ratio, by_ratio).reshape(6 * K, 6 * N)
    summing = _adjoint_inverse_changes(grasps)  # robot i sums to {1} what is its own, so the others stay
    of_robot = np.repeat(np.arange(1, N), 6)
    summed = np.moveaxis(summing, -1, -2) @ np.moveaxis(wrench, 0, -1)[of_robot]

    def changed(stacked: Array) -> Array:  # components apart in memory
        return np.moveaxis((dG @ stacked.reshape(Q, -1).T).reshape(K, 6, Q), 1, 2)

    ups = robot_up(R_bi, grasps)
    total = ups.sum(axis=1)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    mean = total / length
    up = np.zeros((N - 1, 6, Q, 3))
    up[:, :3] = so3.cross(np.eye(3)[:, None], np.moveaxis(ups[:, 1:], 1, 0)[:, None])
    up = up.reshape(K, Q, 3)
    up -= np.sum(up * mean, axis=-1, keepdims=True) * mean
    wrenches = np.moveaxis(summed, 1, 2)
    return FusionChanges(
        changed(twist), changed(twist_dot), up / length, wrenches[..., 3:], wrenches[..., :3]
    )


def fusion_matrix(grasps: GraspEstimate) -> Array:
    """G with V_1 = G [V_1; ...; V_N], shape (6, 6N)."""
    return np.eye(6) if grasps.robots == 1 else fusion_with(grasps, _ratio(grasps)[0])


def _ratio(grasps: GraspEstimate) -> tuple[float, Array]:
    """Weight of linear residuals [rad/m] beside angular ones, and its derivative by the grasps' errors, (6(N-1),)."""
    N, off = grasps.robots, ~np.eye(grasps.robots, dtype=bool)
    if N == 1:
        return 1.0, np.zeros(0)
    angular = float(np.mean(grasps.angular_residual_rms[off] ** 2)) / 2
    # The linear residual also holds the angular noise of the mean times the distance; take that part out.
    apart = grasps.p_1i[:, None] - grasps.p_1i[None]
    pair = float(np.mean(grasps.linear_residual_rms[off] ** 2))
    share = angular / N * 2 / 3
    open_part = pair - share * float(np.mean(np.sum(apart**2, axis=2)[off]))
    linear = max(open_part, 0.1 * pair) / 2
    by_errors = np.zeros((N, 6))
    if not (angular > 0 and linear > 0):
        return 1.0, by_errors[1:].ravel()
    ratio = float(np.sqrt(angular / linear))
    if open_part > 0.1 * pair:
        by_errors[:, 3:] = 0.25 * ratio / linear * share * 4.0 / (N * (N - 1)) * apart.sum(axis=1)
    return ratio, by_errors[1:].ravel()


def fusion_with(grasps: GraspEstimate, ratio: float) -> Array:
    """The same with linear residuals weighted by ``ratio`` [rad/m], angular ones by 1."""
    weights = np.array([1.0, 1.0, 1.0, ratio, ratio, ratio])
    H = (weights[:, None] * _adjoint_inverses(grasps)).reshape(-1, 6)
    return np.asarray(np.linalg.pinv(H) * np.tile(weights, grasps.robots), dtype=float)


def _fusion_matrix_changes(grasps: GraspEstimate, ratio: float, by_ratio: Array) -> Array:
    """Derivative of ``fusion_with`` by the grasps' errors, the ratio's with it, shape (K, 6, 6N).

    G = H^+ W with W the weights and H = W Ad^-1 of full rank: dH^+ = -H^+ dH H^+ + (H^T H)^-1 dH^T (1 - H H^+)
    (G. Golub, V. Pereyra, SIAM J. Numer. Anal. 10, 1973).
    """
    N, K = grasps.robots, len(by_ratio)
    weights, by_weights = np.repeat([1.0, ratio], 3), np.repeat([0.0, 1.0], 3)
    inverses = _adjoint_inverses(grasps)
    H = (weights[:, None] * inverses).reshape(-1, 6)
    dH = np.zeros((K, N, 6, 6))
    dH[np.arange(K), np.repeat(np.arange(1, N), 6)] = weights[:, None] * _adjoint_inverse_changes(grasps)
    dH = (dH + by_ratio[:, None, None, None] * by_weights[:, None] * inverses).reshape(K, 6 * N, 6)
    back = np.linalg.pinv(H)
    beyond = np.eye(6 * N) - H @ back
    d_back = -back @ dH @ back + (back @ back.T) @ np.swapaxes(dH, 1, 2) @ beyond
    return d_back * np.tile(weights, N) + by_ratio[:, None, None] * back * np.tile(by_weights, N)


def total_wrench(wrench: Array, grasps: GraspEstimate) -> tuple[Array, Array]:
    """Sum of the wrenches at the origin of {1}, in {1}: force [N] and moment [N m].

    ``wrench`` has shape (Q, N, 6), (m_i, f_i) in {i}; the sums have shape (Q, 3). Equations (10), (19): the
    grasp moments m_i count too.
    """
    # [Ad_T_i1]^T takes a wrench from {i} to {1}; side by side they add up all robots' in one product.
    total = wrench.reshape(len(wrench), -1) @ _adjoint_inverses(grasps).reshape(-1, 6)
    return total[:, 3:], total[:, :3]


def fused_up(R_bi: Array, grasps: GraspEstimate) -> Array:
    """Unit vector against gravity in {1}, mean over the robots' gimbals, shape (Q, N, 3, 3) -> (Q, 3)."""
    up = R_bi[..., 2, :].reshape(len(R_bi), -1) @ grasps.R_1i.transpose(0, 2, 1).reshape(-1, 3)
    return up / np.linalg.norm(up, axis=1, keepdims=True)


def robot_up(R_bi: Array, grasps: GraspEstimate) -> Array:
    """The same by each robot alone: R_1i R_bi^T z, shape (Q, N, 3)."""
    return np.einsum("iab,qib->qia", grasps.R_1i, R_bi[..., 2, :])


def tilt_scatter(R_bi: Array, grasps: GraspEstimate) -> float:
    """Sum of squares of what the robots' tilts disagree by [rad^2], each robot's constant offset taken out."""
    up = robot_up(R_bi, grasps)
    apart = up - up.mean(axis=1, keepdims=True)
    apart -= apart.mean(axis=0)
    return float(np.sum(apart**2))


def acceleration_noise(data: GraspData, grasps: GraspEstimate) -> float:
    """Disagreement of the robots about the angular acceleration, rms per component of one robot [rad/s^2].

    Zero for one robot, which has nobody to disagree with.
    """
    if grasps.robots == 1:
        return 0.0
    alpha = np.einsum("iab,qib->qia", grasps.R_1i, data.twist_dot[..., :3])
    return float(np.sqrt(np.mean(np.var(alpha, axis=1, ddof=1))))


def _adjoint_inverses(grasps: GraspEstimate) -> Array:
    """[Ad_T_1i]^-1 of all robots, equation (2), shape (N, 6, 6)."""
    out = np.zeros((grasps.robots, 6, 6))
    back = np.swapaxes(grasps.R_1i, 1, 2)
    out[:, :3, :3] = out[:, 3:, 3:] = back
    out[:, 3:, :3] = -back @ so3.skew(grasps.p_1i)
    return out


def _adjoint_inverse_changes(grasps: GraspEstimate) -> Array:
    """Derivatives of each robot's by its own errors (d_i, e_i), robot by robot from the second, shape (K, 6, 6)."""
    out = np.zeros((grasps.robots - 1, 6, 6, 6))
    turned = np.swapaxes(grasps.R_1i[1:], 1, 2)[:, None] @ so3.skew(np.eye(3))  # -d(R^T) by d_i
    out[:, :3, :3, :3] = out[:, :3, 3:, 3:] = -turned
    out[:, :3, 3:, :3] = turned @ so3.skew(grasps.p_1i[1:])[:, None]
    out[:, 3:, 3:, :3] = -turned
    return out.reshape(-1, 6, 6)
