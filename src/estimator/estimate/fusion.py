"""One motion of the payload from all robots' twists, given the grasp frames."""

from dataclasses import dataclass

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


def fusion_matrix(grasps: GraspEstimate) -> Array:
    """G with V_1 = G [V_1; ...; V_N], shape (6, 6N)."""
    N = grasps.robots
    if N == 1:
        return np.eye(6)
    off = ~np.eye(N, dtype=bool)
    angular = float(np.mean(grasps.angular_residual_rms[off] ** 2)) / 2
    # The linear residual also holds the angular noise of the mean times the distance; take that part out.
    distance = np.linalg.norm(grasps.p_1i[:, None] - grasps.p_1i[None], axis=2)[off]
    pair = float(np.mean(grasps.linear_residual_rms[off] ** 2))
    linear = max(pair - angular / N * float(np.mean(distance**2)) * 2 / 3, 0.1 * pair) / 2
    ratio = np.sqrt(angular / linear) if angular > 0 and linear > 0 else 1.0
    return fusion_with(grasps, ratio)


def fusion_with(grasps: GraspEstimate, ratio: float) -> Array:
    """The same with linear residuals weighted by ``ratio`` [rad/m], angular ones by 1."""
    weights = np.array([1.0, 1.0, 1.0, ratio, ratio, ratio])
    H = np.concatenate([weights[:, None] * np.linalg.inv(_adjoint(grasps, i)) for i in range(grasps.robots)])
    return np.asarray(np.linalg.pinv(H) * np.tile(weights, grasps.robots), dtype=float)


def total_wrench(wrench: Array, grasps: GraspEstimate) -> tuple[Array, Array]:
    """Sum of the wrenches at the origin of {1}, in {1}: force [N] and moment [N m].

    ``wrench`` has shape (Q, N, 6), (m_i, f_i) in {i}; the sums have shape (Q, 3). Equations (10), (19): the
    grasp moments m_i count too.
    """
    # [Ad_T_i1]^T takes a wrench from {i} to {1}; side by side they add up all robots' in one product.
    total = wrench.reshape(len(wrench), -1) @ np.vstack(
        [np.linalg.inv(_adjoint(grasps, i)) for i in range(grasps.robots)]
    )
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


def _adjoint(grasps: GraspEstimate, i: int) -> Array:
    """[Ad_T_1i], equation (2), shape (6, 6)."""
    R = grasps.R_1i[i]
    Ad = np.zeros((6, 6))
    Ad[:3, :3] = Ad[3:, 3:] = R
    Ad[3:, :3] = so3.skew(grasps.p_1i[i]) @ R
    return Ad
