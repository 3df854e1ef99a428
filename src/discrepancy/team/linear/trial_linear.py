"""One trial, linearised: its residual, how robots' signals and unknowns move it, and its whitening."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from discrepancy import rules
from discrepancy.team.linear.noise import Noise
from discrepancy.team.linear.reduction import Reduction
from discrepancy.team.linear.residual import (
    SIGNALS,
    Bases,
    Shared,
    balance,
    grasp_data,
    pose_error,
    pose_residual,
    robot_data,
)
from discrepancy.team.linear.signals import Signals, with_rates
from estimator.arm.design import OmnidDesign
from estimator.estimate.fusion import fuse, fusion_matrix
from estimator.estimate.principal import inertia_matrix
from estimator.signals.grasp_data import GraspData

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class TrialLinear:
    """Linearisation of one trial around nominal unknowns; samples at the recording's rate, rows reduced.

    Attributes:
        signals: the (corrected) signals.
        s: filtered signals, shape (Q, N, 21).
        data: data points of all robots.
        shared, bases: nominal unknowns.
        design: the robots' numbers.
        reduction: samples to rows.
        residual: shape (n, C) with C = 6 N channels.
        J: derivative of the residual's samples by robot i's 21 signals, shape (N, Q, C, 21).
        by_shared: derivative by ``Shared.moved``, shape (n, C, 6 (N - 1) + 10).
        by_bases: derivative by ``Bases.moved``, shape (n, C, 4 (N - 1)).
    """

    signals: Signals
    s: Array
    data: GraspData
    shared: Shared
    bases: Bases
    design: OmnidDesign
    reduction: Reduction
    residual: Array
    J: Array
    by_shared: Array
    by_bases: Array

    @property
    def robots(self) -> int:
        """Number of robots N."""
        return self.s.shape[1]

    @property
    def channels(self) -> int:
        """Number of residual channels, 6 N."""
        return 6 * self.robots

    def of_signals(
        self, robot: int, phi: Array | None = None, theta: Array | None = None, tau: Array | None = None
    ) -> Array:
        """What errors of one robot's readings add to the residual, shape (n, C).

        Args:
            robot: index of the robot, from 0.
            phi, theta: reading minus truth [rad], shape (Q, 3) or (3,).
            tau: the same [N m].
        """
        rate, samples = self.signals.rate_hz, len(self.signals.time)
        total = np.zeros((samples, self.channels))
        for at, error in ((0, phi), (9, theta)):
            if error is None:
                continue
            if error.ndim == 1:
                total += self.J[robot, :, :, at : at + 3] @ error
            else:
                parts = with_rates(error, rate).transpose(1, 0, 2).reshape(samples, 9)
                total += np.einsum("qcs,qs->qc", self.J[robot, :, :, at : at + 9], parts)
        if tau is not None:
            tau = np.broadcast_to(tau, (samples, 3))
            total += np.einsum("qcs,qs->qc", self.J[robot, :, :, 18:], tau)
        return self.reduction(total)

    def of_wrench(self, force: Array, moment: Array) -> Array:
        """What an outside wrench at the origin of {1} on the payload, in {1}, adds, shape (n, C).

        The robots then have to exert less: they and the outside together move the payload.

        Args:
            force, moment: [N], [N m], shape (Q, 3).
        """
        total = np.zeros((len(force), self.channels))
        total[:, -6:-3], total[:, -3:] = -force, -moment
        return self.reduction(total)

    def of_pose(self, robot: int, rotation: Array | None, displacement: Array | None) -> Array:
        """What a small motion of robot i's grasp frame as seen from {b1} adds, shape (n, C).

        The poses that the other robots and the joint angles tell of stay as they are; robot 1's own
        displacement moves all others the opposite way.

        Args:
            robot: index of the robot, from 0.
            rotation: true minus assumed, rotation vector in {b1} [rad], shape (Q, 3) or None.
            displacement: the same [m].
        """
        samples = len(self.signals.time)
        total = np.zeros((samples, self.channels))
        for i in range(1, self.robots):
            sign = 1.0 if robot == 0 else -1.0 if robot == i else 0.0
            for at, x in ((6 * (i - 1), rotation), (6 * (i - 1) + 3, displacement)):
                if x is not None:
                    total[:, at : at + 3] += sign * x
        if displacement is not None:
            total[:, -6:] = self._of_wrong_motion(robot, -displacement @ self.bases.R[robot])
        return self.reduction(total)

    def _of_wrong_motion(self, robot: int, wrist: Array) -> Array:
        """Wrench balance, shape (Q, 6), of a wrist that does not move with the payload: by ``wrist`` [m], in {b_i}."""
        rates = np.concatenate(with_rates(wrist, self.signals.rate_hz)[1:], axis=1)
        return np.asarray((self._by_wrist[robot] @ rates[..., None])[..., 0])

    @cached_property
    def _by_wrist(self) -> Array:
        """Derivative of the balance by velocity and acceleration of a wrist in {b_i}, shape (N, Q, 6, 6).

        Only by the payload's motion, which is taken from all wrists; the arm really moves so.
        """
        samples, G = len(self.s), fusion_matrix(self.shared.grasps)
        motion = self.data.twist.reshape(samples, -1) @ G.T
        out = np.zeros((self.robots, samples, 6, 6))
        for i in range(self.robots):
            at = slice(6 * i + 3, 6 * i + 6)
            omega = self.data.twist[:, i, :3]
            for k in range(3):
                along = self.data.R_bi[:, i, k]  # unit vector k of {b_i}, in {i}
                none, turned = np.zeros_like(along), -np.cross(omega, along)
                for column, (v, v_dot) in ((k, (along, turned)), (3 + k, (none, along))):
                    needed = _needed(motion, v @ G[:, at].T, v_dot @ G[:, at].T, none, self.shared, self.data)
                    out[i, :, :, column] = -np.concatenate(needed, axis=1)
        return out


def linearise(
    signals: Signals, shared: Shared, bases: Bases, design: OmnidDesign, reduction: Reduction, *, full: bool
) -> TrialLinear:
    """Linearise one trial; without ``full`` the robots' signals are left out (J is empty)."""
    rate = signals.rate_hz
    Q, N = signals.phi.shape[:2]
    phi, theta = with_rates(signals.phi, rate), with_rates(signals.theta, rate)
    tau = with_rates(signals.tau, rate)[:1]
    s = np.concatenate([phi, theta, tau]).transpose(1, 2, 0, 3).reshape(Q, N, SIGNALS)
    data = grasp_data(s, design, rate)
    force, Y = balance(data, shared)
    pose = pose_residual(signals.phi, signals.theta, shared, bases, design)
    residual = reduction(np.concatenate([pose, force], axis=1))

    C, split = 6 * N, 6 * (N - 1)
    by_shared = np.zeros((Q, C, split + 10))
    by_bases = np.zeros((Q, split, 4 * (N - 1)))
    by_shared[:, split:, split:] = -Y
    for k in range(split):
        at = np.zeros(split + 10)
        ends = []
        for at[k] in (1e-5, -1e-5):
            moved = shared.moved(at)
            pose = pose_error(data.R_bi, data.p_bi, moved, bases)
            ends.append(np.concatenate([pose, balance(data, moved)[0]], axis=1))
        by_shared[:, :, k] = (ends[0] - ends[1]) / 2e-5
    for k in range(4 * (N - 1)):
        at = np.zeros(4 * (N - 1))
        ends = []
        for at[k] in (1e-5, -1e-5):
            ends.append(pose_error(data.R_bi, data.p_bi, shared, bases.moved(at)))
        by_bases[:, :, k] = (ends[0] - ends[1]) / 2e-5
    J = _by_signals(s, data, shared, bases, design) if full else np.zeros((N, 0, C, SIGNALS))
    padded = np.zeros((len(reduction.sample), C, by_bases.shape[2]))
    padded[:, :split] = reduction(by_bases)
    return TrialLinear(
        signals, s, data, shared, bases, design, reduction, residual, J, reduction(by_shared), padded
    )


_STEPS = np.repeat([1e-6, 1e-5, 1e-4, 1e-6, 1e-5, 1e-4, 1e-4], 3)


def _by_signals(s: Array, data: GraspData, shared: Shared, bases: Bases, design: OmnidDesign) -> Array:
    """Derivative of the residual by every robot's signals, shape (N, Q, C, 21).

    Central differences through one robot's own formulas, then by hand through what is linear in the robots;
    evaluated at 25 Hz.
    """
    samples, every = len(s), max(1, round(data.rate_hz / rules.TEAM_JACOBIAN_HZ))
    knots = np.arange(0, samples, every)
    s = s[knots]
    data = _thinned(data, knots)
    Q, N = s.shape[:2]
    grasps = shared.grasps
    motion = fuse(data, grasps)
    fused = data.twist.reshape(Q, -1) @ fusion_matrix(grasps).T
    J = np.zeros((N, Q, 6 * N, SIGNALS))
    for i in range(N):
        G = fusion_matrix(grasps)[:, 6 * i : 6 * i + 6]
        R_1i, p_1i = grasps.R_1i[i], grasps.p_1i[i]
        for k in range(SIGNALS):
            ends = []
            for sign in (1.0, -1.0):
                moved = s[:, i].copy()
                moved[:, k] += sign * _STEPS[k]
                ends.append(robot_data(moved, design))
            dR, dh, dV, dV_dot, dF = (
                (a - b) / (2.0 * _STEPS[k]) for a, b in zip(ends[0], ends[1], strict=True)
            )
            turn = _vee(dR @ np.swapaxes(data.R_bi[:, i], -1, -2))  # in {b_i}
            for j in range(1, N):
                at = 6 * (j - 1)
                if i == 0:
                    J[i, :, at : at + 3, k] = -turn
                    J[i, :, at + 3 : at + 6, k] = -dh - dR @ grasps.p_1i[j]
                elif i == j:
                    J[i, :, at : at + 3, k] = turn @ bases.R[j].T
                    J[i, :, at + 3 : at + 6, k] = dh @ bases.R[j].T
            d_up = dR[:, 2] @ R_1i.T / N
            d_up -= np.sum(d_up * motion.up, axis=1, keepdims=True) * motion.up
            needed = _needed(fused, dV @ G.T, dV_dot @ G.T, d_up, shared, data)
            d_force, d_moment = dF[:, 3:] @ R_1i.T, dF[:, :3] @ R_1i.T
            d_moment = d_moment + np.cross(p_1i, d_force)
            J[i, :, -6:-3, k], J[i, :, -3:, k] = d_force - needed[0], d_moment - needed[1]
    # It varies as slowly as the motion: a straight line between its values is good to 1e-3.
    at = np.minimum(np.arange(samples) / every, Q - 1.0)
    low = np.minimum(at.astype(int), max(Q - 2, 0))
    weight = (at - low)[None, :, None, None]
    return J[:, low] * (1.0 - weight) + J[:, np.minimum(low + 1, Q - 1)] * weight


def _needed(
    motion: Array, twist: Array, twist_dot: Array, up: Array, shared: Shared, data: GraspData
) -> tuple[Array, Array]:
    """Force and moment that a change of the payload's motion asks for, in {1}, shape (Q, 3) each.

    Args:
        motion: its twist, shape (Q, 6).
        twist, twist_dot, up: changes of its twist, of that one's rate, and of the vertical.
        shared: its inertia.
        data: for gravity.
    """
    mass, mass_c, inertia = shared.pi[0], shared.pi[1:4], inertia_matrix(shared.pi[4:])
    omega, v = motion[:, :3], motion[:, 3:]
    d_omega, d_alpha = twist[:, :3], twist_dot[:, :3]
    accel = twist_dot[:, 3:] + np.cross(d_omega, v) + np.cross(omega, twist[:, 3:]) + data.gravity_mps2 * up
    force = mass * accel + np.cross(d_alpha, mass_c)
    force += np.cross(d_omega, np.cross(omega, mass_c)) + np.cross(omega, np.cross(d_omega, mass_c))
    moment = np.cross(mass_c, accel) + d_alpha @ inertia
    return force, moment + np.cross(d_omega, omega @ inertia) + np.cross(omega, d_omega @ inertia)


def _thinned(data: GraspData, rows: NDArray[np.intp]) -> GraspData:
    arrays = {f: getattr(data, f)[rows] for f in ("time", "R_bi", "p_bi", "twist", "twist_dot", "wrench")}
    return GraspData(**arrays, rate_hz=data.rate_hz, gravity_mps2=data.gravity_mps2)


def _vee(A: Array) -> Array:
    """Vector of the skew part of matrices, shapes (..., 3, 3) -> (..., 3)."""
    low, high = A[..., (2, 0, 1), (1, 2, 0)], A[..., (1, 2, 0), (2, 0, 1)]
    return 0.5 * (low - high)


def start_bases(signals: Signals, shared: Shared, design: OmnidDesign) -> Bases:
    """Poses of the bases from the grasps and the mean of what the joints say."""
    from estimator import so3
    from estimator.arm.delta import forward_kinematics
    from estimator.arm.gimbal import rotation

    keep = signals.keep
    R, h = rotation(signals.theta[keep]), forward_kinematics(signals.phi[keep], design)
    N = R.shape[1]
    turns, places = [np.eye(3)], [np.zeros(3)]
    for i in range(1, N):
        mean = so3.chordal_mean(R[:, 0] @ shared.grasps.R_1i[i] @ np.swapaxes(R[:, i], -1, -2))
        yaw = np.arctan2(mean[1, 0] - mean[0, 1], mean[0, 0] + mean[1, 1])
        turns.append(Rotation.from_rotvec([0.0, 0.0, yaw]).as_matrix())
        places.append(np.mean(h[:, 0] + R[:, 0] @ shared.grasps.p_1i[i] - h[:, i] @ turns[i].T, axis=0))
    return Bases(np.array(turns), np.array(places))


def noise_rows(
    trial: TrialLinear, noise: Noise, rng: np.random.Generator, draws: int = rules.NOISE_DRAWS
) -> tuple[Array, Array]:
    """What the sensors' errors alone would leave: residuals (draws, n, C), and the torques' own (draws, n, N, 3)."""
    out, torques = [], []
    for _ in range(draws):
        errors = noise.draw(trial.signals, rng)
        out.append(
            sum(
                trial.of_signals(i, errors.phi[:, i], errors.theta[:, i], errors.tau[:, i])
                for i in range(trial.robots)
            )
        )
        torques.append(trial.reduction(errors.tau))
    return np.array(out), np.array(torques)
