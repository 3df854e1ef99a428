"""The stacked residual of one trial: rigid grasps between robots, and Newton-Euler of the payload.

Per instant 6 N numbers. For every robot i >= 2, with the poses of the bases constant,

    e_rot = log(R_b1bi R_bi R_1i^T R_b1^T),   e_pos = p_b1bi + R_b1bi h_i - h_1 - R_b1 p_1i    (axes of {b1})

and once (f, M) - Y pi: the sum of the robots' wrenches at the origin of {1} against the payload's ten inertial
parameters. All are zero, at every instant, for a rigid payload in ideal robots.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from estimator import so3
from estimator.arm.delta import forward_kinematics
from estimator.arm.dynamics import rotation
from estimator.arm.motion import ArmData, arm_data
from estimator.arm.unit import Arms, levelled
from estimator.arrays import Array, inertia_matrix
from estimator.estimate.grasps import GraspEstimate
from estimator.signals import GraspData
from estimator.so3 import cross


def momentum_regressor(w: Array) -> Array:
    """L(w) with L(w) I_reg = I w and I_reg as in (20), shapes (..., 3) -> (..., 3, 6); (21) is L(alpha)."""
    w = np.asarray(w, dtype=float)
    x, y, z = w[..., 0], w[..., 1], w[..., 2]
    L = np.zeros((*w.shape, 6))
    L[..., 0, 0], L[..., 0, 1], L[..., 0, 2] = x, y, z
    L[..., 1, 1], L[..., 1, 3], L[..., 1, 4] = x, y, z
    L[..., 2, 2], L[..., 2, 4], L[..., 2, 5] = x, y, z
    return L


def inertia_regressor(omega: Array, alpha: Array) -> Array:
    """A + B of (21)-(24): (A + B) I_reg = I alpha + omega x I omega, shapes (..., 3) -> (..., 3, 6).

    B = [omega] L(omega). The paper prints B as six rows of three: its rows 1-3 are columns 1-3 and its rows
    4-6 are columns 4-6 of the 3 x 6 matrix meant.
    """
    return momentum_regressor(alpha) + so3.skew(omega) @ momentum_regressor(omega)


def inertia_regressor_changes(omega: Array, d_omega: Array, d_alpha: Array, moment: Array) -> Array:
    """Changes of sum_q (A + B)^T m, with A + B as of ``inertia_regressor``, by changes of the motion, (K, 6).

    ``omega`` and ``moment``, m, have shape (Q, 3); the changes of omega and of alpha have shape (K, Q, 3).
    """
    # L(w)^T m is linear in w m^T, and [omega]^T m = m x omega.
    outer = np.swapaxes(d_alpha, 1, 2) @ moment + np.swapaxes(d_omega, 1, 2) @ so3.cross(moment, omega)
    outer += omega.T @ so3.cross(moment, d_omega)
    both = outer + np.swapaxes(outer, 1, 2)
    i, j = np.triu_indices(3)
    return np.where(i == j, 0.5, 1.0) * both[:, i, j]


def newton_euler_regressor(omega: Array, alpha: Array, specific_force: Array) -> Array:
    """Regressor of (f, M) at the origin of {1} by (m, m c, Jxx, Jxy, Jxz, Jyy, Jyz, Jzz), shape (Q, 6, 10).

    From angular velocity and acceleration and the specific force G = a + g up [m/s^2] in {1}, shape (Q, 3) each.
    """
    W = so3.skew(omega)
    Y = np.zeros((len(omega), 6, 10))
    Y[:, :3, 0] = specific_force
    Y[:, :3, 1:4] = so3.skew(alpha) + W @ W
    Y[:, 3:, 1:4] = -so3.skew(specific_force)
    Y[:, 3:, 4:] = inertia_regressor(omega, alpha)
    return Y


class BodyMotion(NamedTuple):
    """Motion of the payload and the load on it, in {1}; shape (Q, 3) each.

    Attributes:
        omega, alpha: angular velocity [rad/s] and acceleration [rad/s^2].
        acceleration: of the origin of {1} (v-dot + omega x v) [m/s^2].
        up: unit vector against gravity.
        force, moment: sum of the robots' wrenches at the origin of {1} [N, N m].
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
    """Derivatives of a motion by the K = 6(N-1) errors of the grasps (``GraspEstimate.covariance``).

    Of the payload's twist in {1} and its component-wise derivative, shape (K, Q, 6), and of ``up``, ``force`` and
    ``moment`` as in ``BodyMotion``, shape (K, Q, 3).
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
    """Derivatives of ``fuse`` at twists, orientations and wrenches as of ``GraspData``.

    ``ratio`` is a fixed weight as of ``fusion_with``; None takes that of ``fusion_matrix``, which changes with grasps.
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
    """``fusion_matrix`` with linear residuals weighted by ``ratio`` [rad/m], angular ones by 1."""
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
    """Sum of the wrenches (m_i, f_i) in {i}, (Q, N, 6), at the origin of {1}, in {1}: force and moment, (Q, 3) each.

    Equations (10), (19): the grasp moments m_i count too.
    """
    # [Ad_T_i1]^T takes a wrench from {i} to {1}; side by side they add up all robots' in one product.
    total = wrench.reshape(len(wrench), -1) @ _adjoint_inverses(grasps).reshape(-1, 6)
    return total[:, 3:], total[:, :3]


def fused_up(R_bi: Array, grasps: GraspEstimate) -> Array:
    """Unit vector against gravity in {1}, mean over the robots' gimbals, shape (Q, N, 3, 3) -> (Q, 3)."""
    up = R_bi[..., 2, :].reshape(len(R_bi), -1) @ grasps.R_1i.transpose(0, 2, 1).reshape(-1, 3)
    return up / np.linalg.norm(up, axis=1, keepdims=True)


def robot_up(R_bi: Array, grasps: GraspEstimate) -> Array:
    """Unit vector against gravity in {1} by each robot alone: R_1i R_bi^T z, shape (Q, N, 3)."""
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


@dataclass(frozen=True, eq=False)
class Shared:
    """What all trials have in common: the grasp frames X_1i, and pi = (m, m c, J about {1}), shape (10,)."""

    grasps: GraspEstimate
    pi: Array

    def moved(self, x: Array) -> Shared:
        """Changed by x = (d_i, e_i for i >= 2, pi), shape (6 (N - 1) + 10,)."""
        split = 6 * (self.grasps.robots - 1)
        return replace(self, grasps=self.grasps.moved(x[:split]), pi=self.pi + x[split:])


@dataclass(frozen=True, eq=False)
class Bases:
    """Poses of the robots' bases in {b1} during one trial; index 0 is robot 1 itself.

    ``R`` are rotations about z, shape (N, 3, 3), ``p`` positions [m], shape (N, 3).
    """

    R: Array
    p: Array

    def moved(self, x: Array) -> Bases:
        """Changed by x = (dx, dy, dz, dyaw for i >= 2), shape (4 (N - 1),)."""
        x = x.reshape(-1, 4)
        turn = Rotation.from_rotvec(np.column_stack([np.zeros((len(x), 2)), x[:, 3]])).as_matrix()
        return Bases(
            np.concatenate([self.R[:1], turn @ self.R[1:]]),
            np.concatenate([self.p[:1], self.p[1:] + x[:, :3]]),
        )


def poses(phi: Array, theta: Array, arms: Arms) -> tuple[Array, Array]:
    """R_bi and h [m] in level base frames, (..., N, 3, 3) and (..., N, 3), from true angles (..., N, 3)."""
    return levelled(arms, rotation(theta), forward_kinematics(phi, arms))


def pose_residual(phi: Array, theta: Array, shared: Shared, bases: Bases, arms: Arms) -> Array:
    """e_rot [rad] and e_pos [m] of the robots i >= 2, shape (Q, 6 (N - 1)), from true angles (Q, N, 3)."""
    return pose_error(*poses(phi, theta, arms), shared, bases)


def pose_error(R: Array, h: Array, shared: Shared, bases: Bases) -> Array:
    """``pose_residual`` from R_bi (Q, N, 3, 3) and h (Q, N, 3)."""
    grasps = shared.grasps
    parts = []
    for i in range(1, grasps.robots):
        back = R[:, 0] @ grasps.R_1i[i]  # R_b1 R_1i
        parts.append(Rotation.from_matrix(bases.R[i] @ R[:, i] @ np.swapaxes(back, -1, -2)).as_rotvec())
        parts.append(bases.p[i] + h[:, i] @ bases.R[i].T - h[:, 0] - R[:, 0] @ grasps.p_1i[i])
    return np.concatenate(parts, axis=1) if parts else np.zeros((len(R), 0))


def robot_data(s: Array, arms: Arms) -> ArmData:
    """R_bi and h in level base frames, twist, twist_dot and wrench of robots whose true signals are s, (Q, ..., 21).

    ``arms`` are of one robot, or of all in the axis before the last.
    """
    phi, phi_dot, phi_ddot, theta, theta_dot, theta_ddot, tau = np.moveaxis(
        s.reshape(*s.shape[:-1], 7, 3), -2, 0
    )
    data = arm_data((phi, phi_dot, phi_ddot), (theta, theta_dot, theta_ddot), tau, arms)
    R_bi, h = levelled(arms, data.R_bi, data.h)
    return data._replace(R_bi=R_bi, h=h)


def payload_equations(data: GraspData, grasps: GraspEstimate) -> tuple[Array, Array]:
    """Y (Q, 6, 10) and (f, M) of the robots (Q, 6) [N, N m], which are Y pi for a rigid payload."""
    motion = fuse(data, grasps)
    specific = motion.acceleration + data.gravity_mps2 * motion.up
    Y = newton_euler_regressor(motion.omega, motion.alpha, specific)
    return Y, np.concatenate([motion.force, motion.moment], axis=1)


def balance(data: GraspData, shared: Shared) -> tuple[Array, Array]:
    """(f, M) of the robots minus Y pi [N, N m], shape (Q, 6), and Y, shape (Q, 6, 10)."""
    Y, wrench = payload_equations(data, shared.grasps)
    return wrench - Y @ shared.pi, Y


def grasp_data(s: Array, arms: Arms, rate_hz: float) -> GraspData:
    """Data points of all robots from true signals s, shape (Q, N, 21); time is not needed here."""
    R, h, twist, twist_dot, wrench = robot_data(s, arms)
    return GraspData(np.zeros(len(s)), R, h, twist, twist_dot, wrench, rate_hz, arms.gravity_mps2)


def start_bases(R: Array, h: Array, shared: Shared) -> Bases:
    """Bases of one trial, in which all robots agree on average about where the payload is.

    From orientations R_bi (Q, N, 3, 3), wrist positions in {b} (Q, N, 3) [m], and how the payload is held.
    """
    turns, places = [np.eye(3)], [np.zeros(3)]
    for i in range(1, h.shape[1]):
        mean = so3.chordal_mean(R[:, 0] @ shared.grasps.R_1i[i] @ np.swapaxes(R[:, i], -1, -2))
        yaw = np.arctan2(mean[1, 0] - mean[0, 1], mean[0, 0] + mean[1, 1])
        turns.append(Rotation.from_rotvec([0.0, 0.0, yaw]).as_matrix())
        places.append(np.mean(h[:, 0] + R[:, 0] @ shared.grasps.p_1i[i] - h[:, i] @ turns[i].T, axis=0))
    return Bases(np.array(turns), np.array(places))


def needed_wrench(
    motion: Array, twist: Array, twist_dot: Array, gravity: Array, pi: Array
) -> tuple[Array, Array]:
    """Force and moment that a change of the payload's motion asks for, in {1}, shape (..., 3) each.

    Args:
        motion: its twist, shape (Q, 6).
        twist, twist_dot: changes of its twist, and of that one's rate, shape (..., Q, 6).
        gravity: change of the vertical times gravity [m/s^2], shape (..., Q, 3).
        pi: its inertial parameters, shape (10,).
    """
    mass, mass_c, inertia = pi[0], pi[1:4], inertia_matrix(pi[4:])
    omega, v = motion[:, :3], motion[:, 3:]
    d_omega, d_alpha = twist[..., :3], twist_dot[..., :3]
    accel = twist_dot[..., 3:] + cross(d_omega, v) + cross(omega, twist[..., 3:]) + gravity
    force = mass * accel + cross(d_alpha, mass_c)
    force += cross(d_omega, cross(omega, mass_c)) + cross(omega, cross(d_omega, mass_c))
    moment = cross(mass_c, accel) + d_alpha @ inertia
    return force, moment + cross(d_omega, omega @ inertia) + cross(omega, d_omega @ inertia)


def vee(A: Array) -> Array:
    """Vector of the skew part of matrices, shapes (..., 3, 3) -> (..., 3)."""
    low, high = A[..., (2, 0, 1), (1, 2, 0)], A[..., (1, 2, 0), (2, 0, 1)]
    return 0.5 * (low - high)
