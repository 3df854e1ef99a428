"""Residuals of one trial: closure of rigid grasps between robots, and Newton-Euler balance of the payload.

There are 6 N residuals per instant. Each robot i >= 2, whose base has a constant pose, contributes

    e_rot = log(R_b1bi R_bi R_1i^T R_b1^T),   e_pos = p_b1bi + R_b1bi h_i - h_1 - R_b1 p_1i    (axes of {b1})

The balance (f, M) - Y pi compares the sum of the robots' wrenches at the origin of {1} with the payload's ten inertial
parameters. For a rigid payload and ideal robots all residuals are zero at every instant.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from estimator import so3
from estimator.arm.delta import forward_kinematics
from estimator.arm.dynamics import rotation
from estimator.arm.motion import COUNT as SLOTS
from estimator.arm.motion import ArmData, arm_data, yaw_matrix
from estimator.arm.unit import Arms, levelled
from estimator.arrays import Array, inertia_matrix
from estimator.estimate.grasps import GraspEstimate
from estimator.signals import GraspData
from estimator.so3 import cross


def momentum_regressor(w: Array) -> Array:
    """Return L(w) with L(w) I_reg = I w and I_reg as in (20), shapes (..., 3) -> (..., 3, 6); (21) is L(alpha)."""
    w = np.asarray(w, dtype=float)
    x, y, z = w[..., 0], w[..., 1], w[..., 2]
    L = np.zeros((*w.shape, 6))
    L[..., 0, 0], L[..., 0, 1], L[..., 0, 2] = x, y, z
    L[..., 1, 1], L[..., 1, 3], L[..., 1, 4] = x, y, z
    L[..., 2, 2], L[..., 2, 4], L[..., 2, 5] = x, y, z
    return L


def inertia_regressor(omega: Array, alpha: Array) -> Array:
    """Return A + B of (21)-(24): (A + B) I_reg = I alpha + omega x I omega, shapes (..., 3) -> (..., 3, 6).

    B = [omega] L(omega). The paper prints B as six rows of three: its rows 1-3 are columns 1-3 and its rows 4-6 are
    columns 4-6 of the intended 3 x 6 matrix.
    """
    return momentum_regressor(alpha) + so3.skew(omega) @ momentum_regressor(omega)


def inertia_regressor_changes(omega: Array, d_omega: Array, d_alpha: Array, moment: Array) -> Array:
    """Return changes of sum_q (A + B)^T m (see ``inertia_regressor``) due to changes of the motion, shape (K, 6).

    ``omega`` and ``moment`` (m) have shape (Q, 3); the changes of omega and alpha have shape (K, Q, 3).
    """
    # L(w)^T m is linear in w m^T, and [omega]^T m = m x omega.
    outer = np.swapaxes(d_alpha, 1, 2) @ moment + np.swapaxes(d_omega, 1, 2) @ so3.cross(moment, omega)
    outer += omega.T @ so3.cross(moment, d_omega)
    both = outer + np.swapaxes(outer, 1, 2)
    i, j = np.triu_indices(3)
    return np.where(i == j, 0.5, 1.0) * both[:, i, j]


def newton_euler_regressor(omega: Array, alpha: Array, specific_force: Array) -> Array:
    """Return the regressor of (f, M) at the origin of {1}, shape (Q, 6, 10).

    The columns are (m, m c, Jxx, Jxy, Jxz, Jyy, Jyz, Jzz). The arguments are the angular velocity, the angular
    acceleration, and the specific force G = a + g up [m/s^2], all in {1}, shape (Q, 3) each.
    """
    W = so3.skew(omega)
    Y = np.zeros((len(omega), 6, 10))
    Y[:, :3, 0] = specific_force
    Y[:, :3, 1:4] = so3.skew(alpha) + W @ W
    Y[:, 3:, 1:4] = -so3.skew(specific_force)
    Y[:, 3:, 4:] = inertia_regressor(omega, alpha)
    return Y


class BodyMotion(NamedTuple):
    """Motion of the payload and the total wrench on it, in {1}; shape (Q, 3) each.

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
    """Derivatives of a motion with respect to the K = 6(N-1) grasp errors (``GraspEstimate.covariance``).

    ``twist`` (in {1}) and its component-wise derivative ``twist_dot`` have shape (K, Q, 6). ``up``, ``force`` and
    ``moment`` are those of ``BodyMotion``, shape (K, Q, 3).
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
    """Differentiate ``fuse`` at given twists, orientations and wrenches (as in ``GraspData``).

    ``ratio`` is a fixed weight as in ``fusion_with``; None uses that of ``fusion_matrix``, which depends on the
    grasps.
    """
    Q, N = twist.shape[:2]
    K = 6 * (N - 1)
    by_ratio = np.zeros(K)
    if ratio is None:
        ratio, by_ratio = _ratio(grasps)
    dG = _fusion_matrix_changes(grasps, ratio, by_ratio).reshape(6 * K, 6 * N)
    summing = _adjoint_inverse_changes(grasps)  # the errors of robot i change its own wrench only
    of_robot = np.repeat(np.arange(1, N), 6)
    summed = np.moveaxis(summing, -1, -2) @ np.moveaxis(wrench, 0, -1)[of_robot]

    def changed(stacked: Array) -> Array:  # each component contiguous in memory
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
    """Return G with V_1 = G [V_1; ...; V_N], shape (6, 6N)."""
    return np.eye(6) if grasps.robots == 1 else fusion_with(grasps, _ratio(grasps)[0])


def _ratio(grasps: GraspEstimate) -> tuple[float, Array]:
    """Return the weight of linear relative to angular residuals [rad/m], and its derivative by grasp errors."""
    N, off = grasps.robots, ~np.eye(grasps.robots, dtype=bool)
    if N == 1:
        return 1.0, np.zeros(0)
    angular = float(np.mean(grasps.angular_residual_rms[off] ** 2)) / 2
    # The linear residual contains the angular noise of the mean times the distance; subtract that part.
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
    """Return ``fusion_matrix`` with weight ``ratio`` [rad/m] on linear residuals and 1 on angular ones."""
    weights = np.array([1.0, 1.0, 1.0, ratio, ratio, ratio])
    H = (weights[:, None] * _adjoint_inverses(grasps)).reshape(-1, 6)
    return np.asarray(np.linalg.pinv(H) * np.tile(weights, grasps.robots), dtype=float)


def _fusion_matrix_changes(grasps: GraspEstimate, ratio: float, by_ratio: Array) -> Array:
    """Return the derivative of ``fusion_with`` by grasp errors, directly and through ``ratio``, shape (K, 6, 6N).

    G = H^+ W with weights W and H = W Ad^-1 of full rank: dH^+ = -H^+ dH H^+ + (H^T H)^-1 dH^T (1 - H H^+) (G. Golub,
    V. Pereyra, SIAM J. Numer. Anal. 10, 1973).
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
    """Sum the wrenches (m_i, f_i) in {i}, (Q, N, 6), at the origin of {1}: force and moment, (Q, 3) each.

    Equations (10), (19), including the grasp moments m_i. The result is in {1}.
    """
    # [Ad_T_i1]^T takes a wrench from {i} to {1}; one product of the stacked matrices sums all robots.
    total = wrench.reshape(len(wrench), -1) @ _adjoint_inverses(grasps).reshape(-1, 6)
    return total[:, 3:], total[:, :3]


def fused_up(R_bi: Array, grasps: GraspEstimate) -> Array:
    """Unit vector against gravity in {1}, mean over the robots' gimbals, shape (Q, N, 3, 3) -> (Q, 3)."""
    up = R_bi[..., 2, :].reshape(len(R_bi), -1) @ grasps.R_1i.transpose(0, 2, 1).reshape(-1, 3)
    return up / np.linalg.norm(up, axis=1, keepdims=True)


def robot_up(R_bi: Array, grasps: GraspEstimate) -> Array:
    """Return the unit vector against gravity in {1} according to each robot: R_1i R_bi^T z, shape (Q, N, 3)."""
    return np.einsum("iab,qib->qia", grasps.R_1i, R_bi[..., 2, :])


def tilt_scatter(R_bi: Array, grasps: GraspEstimate) -> float:
    """Return the sum of squared differences between the robots' tilts [rad^2], without each robot's constant offset."""
    up = robot_up(R_bi, grasps)
    apart = up - up.mean(axis=1, keepdims=True)
    apart -= apart.mean(axis=0)
    return float(np.sum(apart**2))


def acceleration_noise(data: GraspData, grasps: GraspEstimate) -> float:
    """Return the rms disagreement on angular acceleration, per component and robot [rad/s^2]; 0 for one robot."""
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
    """Return derivatives of ``_adjoint_inverses`` of robots 2 to N by their own errors (d_i, e_i), shape (K, 6, 6)."""
    out = np.zeros((grasps.robots - 1, 6, 6, 6))
    turned = np.swapaxes(grasps.R_1i[1:], 1, 2)[:, None] @ so3.skew(np.eye(3))  # -d(R^T) by d_i
    out[:, :3, :3, :3] = out[:, :3, 3:, 3:] = -turned
    out[:, :3, 3:, :3] = turned @ so3.skew(grasps.p_1i[1:])[:, None]
    out[:, 3:, 3:, :3] = -turned
    return out.reshape(-1, 6, 6)


@dataclass(frozen=True, eq=False)
class Shared:
    """Quantities that all trials share: grasp frames X_1i, and pi = (m, m c, J about {1}), shape (10,)."""

    grasps: GraspEstimate
    pi: Array

    def moved(self, x: Array) -> Shared:
        """Add the errors x = (d_i, e_i for i >= 2, pi), shape (6 (N - 1) + 10,)."""
        split = 6 * (self.grasps.robots - 1)
        return replace(self, grasps=self.grasps.moved(x[:split]), pi=self.pi + x[split:])


@dataclass(frozen=True, eq=False)
class Bases:
    """Poses of the robots' bases in {b1} during one trial; index 0 is robot 1.

    ``R`` are rotations about z, shape (N, 3, 3); ``p`` are positions [m], shape (N, 3).
    """

    R: Array
    p: Array

    def moved(self, x: Array) -> Bases:
        """Add the changes x = (dx, dy, dz, dyaw for i >= 2), shape (4 (N - 1),)."""
        x = x.reshape(-1, 4)
        turn = Rotation.from_rotvec(np.column_stack([np.zeros((len(x), 2)), x[:, 3]])).as_matrix()
        return Bases(
            np.concatenate([self.R[:1], turn @ self.R[1:]]),
            np.concatenate([self.p[:1], self.p[1:] + x[:, :3]]),
        )


def poses(phi: Array, theta: Array, arms: Arms, base: Array | None = None) -> tuple[Array, Array]:
    """Return R_bi and h [m] in level base frames, (..., N, 3, 3) and (..., N, 3), from true angles (..., N, 3).

    With driving bases, ``base`` has their poses (x, y, yaw), (..., N, 3); the frames then are those at the start.
    """
    R, h = levelled(arms, rotation(theta), forward_kinematics(phi, arms))
    if base is None:
        return R, h
    turn = yaw_matrix(base[..., 2])
    return turn @ R, so3.times(turn, h) + base * [1.0, 1.0, 0.0]


def pose_residual(
    phi: Array, theta: Array, shared: Shared, bases: Bases, arms: Arms, base: Array | None = None
) -> Array:
    """Return e_rot [rad] and e_pos [m] of robots i >= 2, shape (Q, 6 (N - 1)), from true angles (Q, N, 3)."""
    return pose_error(*poses(phi, theta, arms, base), shared, bases)


def pose_error(R: Array, h: Array, shared: Shared, bases: Bases) -> Array:
    """Return ``pose_residual`` from R_bi (Q, N, 3, 3) and h (Q, N, 3)."""
    grasps = shared.grasps
    parts = []
    for i in range(1, grasps.robots):
        back = R[:, 0] @ grasps.R_1i[i]  # R_b1 R_1i
        parts.append(Rotation.from_matrix(bases.R[i] @ R[:, i] @ np.swapaxes(back, -1, -2)).as_rotvec())
        parts.append(bases.p[i] + h[:, i] @ bases.R[i].T - h[:, 0] - R[:, 0] @ grasps.p_1i[i])
    return np.concatenate(parts, axis=1) if parts else np.zeros((len(R), 0))


def robot_data(s: Array, arms: Arms) -> ArmData:
    """Return poses in level base frames, twists and wrenches of robots with true signals s, shape (Q, ..., 21).

    ``arms`` describes one robot, or all robots in the axis before the last. With driving bases, s has 30 entries, the
    last nine as ``arm_data`` takes them; poses then are in the base frames at the start.
    """
    phi, phi_dot, phi_ddot, theta, theta_dot, theta_ddot, tau, *_ = np.moveaxis(
        s.reshape(*s.shape[:-1], -1, 3), -2, 0
    )
    base = s[..., SLOTS:] if s.shape[-1] > SLOTS else None
    data = arm_data((phi, phi_dot, phi_ddot), (theta, theta_dot, theta_ddot), tau, arms, base)
    R_bi, h = levelled(arms, data.R_bi, data.h)
    return data._replace(R_bi=R_bi, h=h)


def payload_equations(data: GraspData, grasps: GraspEstimate) -> tuple[Array, Array]:
    """Return Y (Q, 6, 10) and the robots' wrench (f, M) (Q, 6) [N, N m], which equals Y pi for a rigid payload."""
    motion = fuse(data, grasps)
    specific = motion.acceleration + data.gravity_mps2 * motion.up
    Y = newton_euler_regressor(motion.omega, motion.alpha, specific)
    return Y, np.concatenate([motion.force, motion.moment], axis=1)


def balance(data: GraspData, shared: Shared) -> tuple[Array, Array]:
    """Return the robots' (f, M) minus Y pi [N, N m], shape (Q, 6), and Y, shape (Q, 6, 10)."""
    Y, wrench = payload_equations(data, shared.grasps)
    return wrench - Y @ shared.pi, Y


def grasp_data(s: Array, arms: Arms, rate_hz: float) -> GraspData:
    """Return data points of all robots from true signals s, shape (Q, N, 21); the times are set to zero."""
    R, h, twist, twist_dot, wrench = robot_data(s, arms)
    return GraspData(np.zeros(len(s)), R, h, twist, twist_dot, wrench, rate_hz, arms.gravity_mps2)


def start_bases(R: Array, h: Array, shared: Shared) -> Bases:
    """Return base poses of one trial for which all robots agree, on average, on the payload's pose.

    Args:
        R: orientations R_bi, shape (Q, N, 3, 3).
        h: wrist positions in {b} [m], shape (Q, N, 3).
        shared: grasp frames of the payload.
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
    """Return the change of force and moment for a change of the payload's motion, in {1}, shape (..., 3) each.

    Args:
        motion: twist of the payload, shape (Q, 6).
        twist, twist_dot: changes of the twist and of its rate, shape (..., Q, 6).
        gravity: change of the vertical times gravity [m/s^2], shape (..., Q, 3).
        pi: inertial parameters, shape (10,).
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
    """Return the vector of the skew part of matrices, shapes (..., 3, 3) -> (..., 3)."""
    low, high = A[..., (2, 0, 1), (1, 2, 0)], A[..., (1, 2, 0), (2, 0, 1)]
    return 0.5 * (low - high)
