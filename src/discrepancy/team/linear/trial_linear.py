"""Linearise one trial: derivatives of the residual by signals, unknowns and wrenches on the payload."""

from __future__ import annotations

import math
import mmap
import tempfile
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from discrepancy.team.linear.jacobian import BySignals, by_signals
from discrepancy.team.linear.rows import Patches, Reduction
from discrepancy.team.linear.signals import Signals
from estimator.arm.delta import leg_geometry, wrist_motion
from estimator.arm.design import OmnidDesign
from estimator.arm.motion import COUNT, PHI, PHI_DDOT, PHI_DOT, TAU, THETA, with_its_rates
from estimator.arm.unit import Arms, arm_of, design_of
from estimator.arrays import Array
from estimator.calibrate.driven import SCALES
from estimator.calibrate.rows import scaled_paths
from estimator.calibrate.rules import FLOOR_M
from estimator.rigid_team import (
    Bases,
    BodyMotion,
    Shared,
    balance,
    fuse,
    fusion_matrix,
    grasp_data,
    needed_wrench,
    pose_residual,
)
from estimator.signals import GraspData
from estimator.so3 import inverse_left_jacobian, skew

Kind = TypeVar("Kind", bound=np.generic)


def stored(x: NDArray[Kind]) -> NDArray[Kind]:
    """Move an array to a temporary read-only file, which disappears with the array.

    The memory layout stays the same, so that sums keep the same rounding. If no file can be written, the array stays in
    memory.
    """
    if not x.size or is_stored(x):
        return x
    order = np.argsort([-stride for stride in x.strides], kind="stable")
    apart = x.transpose(order)
    try:
        with tempfile.TemporaryFile() as file:
            np.ascontiguousarray(apart).tofile(file)
            file.flush()
            pages = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    except OSError:  # a full disk
        return x
    return np.frombuffer(pages, dtype=x.dtype).reshape(apart.shape).transpose(np.argsort(order))


def is_stored(x: NDArray[np.generic]) -> bool:
    """Whether an array, or the array that it is a view of, is in a file."""
    return _pages(x) is not None


def given_back(*arrays: NDArray[np.generic]) -> None:
    """Release the memory of stored arrays until they are read again; other arrays stay."""
    for x in arrays:
        pages = _pages(x)
        if pages is not None and hasattr(mmap, "MADV_DONTNEED"):
            pages.madvise(mmap.MADV_DONTNEED)


def _pages(x: object) -> mmap.mmap | None:
    """The mapped file behind an array, or None."""
    while isinstance(x, np.ndarray):
        x = x.base
    x = x.obj if isinstance(x, memoryview) else x
    return x if isinstance(x, mmap.mmap) else None


STEP = 1e-5
"""Step of the central differences of the wrench balance by grasps [rad, m]. Chosen."""


def by_shared(data: GraspData, shared: Shared, bases: Bases) -> Array:
    """Derivative of the residual's samples by ``Shared.moved``, shape (Q, 6 N, 6 (N - 1) + 10).

    Each loop depends on its own robot's grasp only. Its rotation residual is log(E), and a grasp rotation d in {1}
    turns E into exp(-R_b1 d) E.
    """
    N, split = data.robots, 6 * (data.robots - 1)
    out = np.zeros((data.samples, 6 * N, split + 10))
    out[:, split:, split:] = -balance(data, shared)[1]
    for k in range(split):
        step = STEP * np.eye(split + 10)[k]
        ends = (balance(data, shared.moved(sign * step))[0] for sign in (1.0, -1.0))
        out[:, split:, k] = (next(ends) - next(ends)) / (2.0 * STEP)
    R_b1 = data.R_bi[:, 0]
    for i in range(1, N):
        about, along = _channels(i)
        out[:, about, about] = -inverse_left_jacobian(-_turned(data, shared, bases, i)) @ R_b1
        out[:, along, along] = -R_b1
    return out


def by_bases(data: GraspData, shared: Shared, bases: Bases) -> Array:
    """Derivative of the residual's samples by ``Bases.moved``, shape (Q, 6 N, 4 (N - 1)).

    A base that turns by yaw turns E into exp(yaw z) E.
    """
    N = data.robots
    out = np.zeros((data.samples, 6 * N, 4 * (N - 1)))
    for i in range(1, N):
        (about, along), column = _channels(i), 4 * (i - 1)
        out[:, along, column : column + 3] = np.eye(3)
        out[:, about, column + 3] = inverse_left_jacobian(_turned(data, shared, bases, i))[..., 2]
        out[:, along, column + 3] = np.cross([0.0, 0.0, 1.0], data.p_bi[:, i] @ bases.R[i].T)
    return out


def _channels(robot: int) -> tuple[slice, slice]:
    """Channels of rotation and position of one robot's loop (robot from 0)."""
    return slice(6 * (robot - 1), 6 * robot - 3), slice(6 * robot - 3, 6 * robot)


def _turned(data: GraspData, shared: Shared, bases: Bases, robot: int) -> Array:
    """Rotation residual e_rot of one robot's loop, shape (Q, 3)."""
    back = data.R_bi[:, 0] @ shared.grasps.R_1i[robot]
    turned = bases.R[robot] @ data.R_bi[:, robot] @ np.swapaxes(back, -1, -2)
    return np.asarray(Rotation.from_matrix(turned).as_rotvec(), dtype=np.float64)


SHIFT_REACH_S = 0.5
"""Time around a displacement in which its accelerations appear [s]. Derived: a 20 Hz filter has decayed to 1e-6."""

CHATTER_JACOBIAN_HZ = 10.0
"""Cut-off of the signals at which chattering trials are linearised [Hz]. Derived: below half the rate of the knots."""


@dataclass(frozen=True, eq=False)
class TrialLinear:
    """Linearisation of one trial around nominal unknowns; samples at the recording's rate, rows reduced.

    Attributes:
        signals: joint signals, corrected by any causes.
        s: filtered signals, shape (Q, N, 21).
        data: data points of all robots.
        shared, bases: nominal unknowns.
        arms: the robots as they are, or as designed.
        reduction: samples to rows.
        residual: shape (n, C) with C = 6 N channels.
        J: derivative of the residual's samples by every robot's 21 signals.
        by_shared: derivative of the rows by ``Shared.moved``, shape (n, C, 6 (N - 1) + 10).
        by_bases: derivative of the rows by ``Bases.moved``, shape (n, C, 4 (N - 1)).
    """

    signals: Signals
    s: Array
    data: GraspData
    shared: Shared
    bases: Bases
    arms: Arms
    reduction: Reduction
    residual: Array
    J: BySignals
    by_shared: Array
    by_bases: Array

    @property
    def design(self) -> OmnidDesign:
        """Nominal design of the robots. It is accurate enough for the effect of a cause."""
        return design_of(self.arms)

    def arm(self, robot: int) -> Arms:
        """Return one robot (from 0) as it is, or as designed."""
        return arm_of(self.arms, robot)

    @cached_property
    def motion(self) -> BodyMotion:
        """Motion of the payload, fused from all robots."""
        return fuse(self.data, self.shared.grasps)

    @cached_property
    def turning(self) -> Array:
        """Derivative of a payload point's acceleration by its position, [alpha] + [omega]^2, shape (Q, 3, 3)."""
        turn = skew(self.motion.omega)
        return skew(self.motion.alpha) + turn @ turn

    @cached_property
    def wrist_accelerations(self) -> Array:
        """Acceleration of every wrist in {b_i} [m/s^2], shape (Q, N, 3)."""
        each = [
            wrist_motion(leg_geometry(s[:, PHI], self.arm(i)), s[:, PHI_DOT], s[:, PHI_DDOT])[1]
            for i, s in enumerate(np.moveaxis(self.s, 1, 0))
        ]
        found = np.stack(each, axis=1)
        return stored(found) if is_stored(self.s) else found

    @property
    def robots(self) -> int:
        """Number of robots N."""
        return self.s.shape[1]

    @property
    def channels(self) -> int:
        """Number of residual channels, 6 N."""
        return 6 * self.robots

    @cached_property
    def adjusted(self) -> Signals:
        """The filtered signals at their adjusted values."""
        phi, theta, tau = (self.s[..., kind] for kind in (PHI, THETA, TAU))
        return replace(self.signals, phi=phi, theta=theta, tau=tau, sampling=None)

    def of_signals(
        self, robot: int, phi: Array | None = None, theta: Array | None = None, tau: Array | None = None
    ) -> Array:
        """Residual rows caused by errors of one robot's readings, shape (n, C).

        Args:
            robot: index from 0.
            phi, theta: reading minus truth [rad], shape (Q, 3) or (3,).
            tau: the same [N m].
        """
        samples = len(self.signals.time)
        total = np.zeros((samples, self.channels))
        for angle, error in ((PHI, phi), (THETA, theta)):
            if error is None:
                continue
            if error.ndim == 1:
                total += self.J(robot, angle, error)
            else:
                parts = self.signals.with_rates(error).transpose(1, 0, 2).reshape(samples, 9)
                total += self.J(robot, with_its_rates(angle), parts)
        if tau is not None:
            total += self.J(robot, TAU, tau)
        return self.reduction(total)

    def of_all_signals(self, phi: Array, theta: Array, tau: Array) -> tuple[Array, Array]:
        """Residual rows caused by errors of all robots' readings, for many draws at once.

        Args:
            phi, theta: reading minus truth [rad], shape (D, Q, N, 3).
            tau: the same [N m].

        Returns:
            Residual rows, shape (D, n, C), and reduced signals, shape (D, n, N, 21).
        """
        D, samples, N = phi.shape[:3]
        angles = self.signals.with_rates(np.stack([phi, theta], axis=3).transpose(1, 2, 3, 4, 0))
        # (3, Q, N, 2, 3, D) to slots: value, rate and acceleration of phi, the same of theta, then tau
        parts = np.concatenate(
            [np.moveaxis(angles, 0, 3).reshape(samples, N, 18, D), np.moveaxis(tau, 0, -1)], axis=2
        )
        total = self.J(0, slice(None), parts[:, 0])
        for i in range(1, N):
            total += self.J(i, slice(None), parts[:, i])
        return np.moveaxis(self.reduction(total), -1, 0), np.moveaxis(self.reduction(parts), -1, 0)

    def of_wrench(self, force: Array, moment: Array) -> Array:
        """Residual rows caused by an external wrench on the payload at the origin of {1}, in {1}, shape (n, C).

        The external wrench takes over a part of what the robots exert.

        Args:
            force, moment: [N], [N m], shape (Q, 3); shape (Q, 3, k) gives (n, C, k).
        """
        rows = self.reduction(-np.concatenate([force, moment], axis=1))
        none = np.zeros((len(rows), self.channels - 6, *rows.shape[2:]))
        return np.concatenate([none, rows], axis=1)

    def of_pose(self, robot: int, rotation: Array | None, displacement: Array | None) -> Array:
        """Residual rows caused by a small motion of robot i's grasp frame in {b1}, shape (n, C).

        The poses from the other robots and from the joint angles stay the same. A displacement of robot 1 moves all
        others the opposite way.

        Args:
            robot: index from 0.
            rotation: true minus assumed, rotation vector in {b1} [rad], shape (Q, 3) or None.
            displacement: true minus assumed [m], shape (Q, 3) or None; shape (Q, 3, k) gives (n, C, k).
        """
        several = () if displacement is None else displacement.shape[2:]
        total = np.zeros((len(self.signals.time), self.channels, *several))
        if rotation is not None:
            for i, sign in self._seen_by(robot):
                total[:, 6 * i : 6 * i + 3] = sign * rotation
        if displacement is not None:
            moved = displacement.reshape(len(total), 3, -1)
            total += self._displaced(robot, moved, slice(None)).reshape(total.shape)
        return self.reduction(total)

    def of_shifts(self, robot: int, along: Array, pieces: Iterable[tuple[slice, Array]]) -> Patches:
        """Residual rows caused by displacements that last for an interval each. Columns without effect are dropped.

        Args:
            robot: index from 0.
            along: direction in {b1}, shape (Q, 3).
            pieces: samples of each interval, and k columns of displacements there [m], shape (s, k).
        """
        reach = math.ceil(SHIFT_REACH_S * self.signals.rate_hz)

        def blocks() -> Iterator[tuple[slice, Array]]:
            for at, values in pieces:
                near = slice(max(at.start - reach, 0), min(at.stop + reach, len(along)))
                moved = np.zeros((near.stop - near.start, 3, values.shape[1]))
                moved[at.start - near.start : at.stop - near.start] = along[at, :, None] * values[:, None]
                yield near, self._displaced(robot, moved, near)

        return self.reduction.of_blocks(blocks(), self.channels)

    def of_misreadings(self, robot: int, joint: int, pieces: Iterable[tuple[slice, Array]]) -> Patches:
        """Residual rows caused by errors of one gimbal angle that last for an interval each.

        Args:
            robot, joint: indices from 0.
            pieces: samples of each interval, and k columns of reading minus truth there [rad], shape (s, k).
        """
        reach, slots = math.ceil(SHIFT_REACH_S * self.signals.rate_hz), with_its_rates(THETA)

        def blocks() -> Iterator[tuple[slice, Array]]:
            for at, values in pieces:
                near = slice(max(at.start - reach, 0), min(at.stop + reach, len(self.s)))
                error = np.zeros((near.stop - near.start, values.shape[1]))
                error[at.start - near.start : at.stop - near.start] = values
                J = self.J.at(robot, slots, np.arange(near.start, near.stop))[:, :, joint::3]
                yield near, np.einsum("scr,rsk->sck", J, self.signals.with_rates(error))

        return self.reduction.of_blocks(blocks(), self.channels)

    def _displaced(self, robot: int, displacement: Array, at: slice) -> Array:
        """Residual samples (s, C, k) caused by displacements (s, 3, k) [m] in {b1}, for the samples ``at``."""
        out = np.zeros((len(displacement), self.channels, displacement.shape[2]))
        for i, sign in self._seen_by(robot):
            out[:, 6 * i + 3 : 6 * i + 6] = sign * displacement
        out[:, -6:] = self._of_wrong_motion(robot, -displacement, at)
        return out

    def _seen_by(self, robot: int) -> list[tuple[int, float]]:
        """Loops whose pose channels depend on the motion of robot i's grasp frame, and the sign."""
        if robot:
            return [(robot - 1, -1.0)]
        return [(i, 1.0) for i in range(self.robots - 1)]

    def _of_wrong_motion(self, robot: int, moved: Array, at: slice) -> Array:
        """Wrench balance (s, 6, k) if a wrist moves relative to the payload by (s, 3, k) [m] in {b1}."""
        wrist = self.bases.R[robot].T @ moved
        rates = np.concatenate(self.signals.with_rates(wrist)[1:], axis=1)
        return np.asarray(self.by_wrist[robot, at] @ rates)

    @cached_property
    def by_clocks(self) -> Array:
        """Derivative by offset [s] and drift of every clock that was aligned by the motion, shape (n, C, 2 k).

        The accuracy of that alignment depends on the motion, so the offsets and drifts of these k robots are nuisance
        parameters.
        """
        signals, columns = self.signals, []
        middle = signals.time - signals.time.mean()
        for i, sampling in enumerate(signals.sampling or ()):
            if sampling.aligned:
                rates = [-signals.with_rates(x[:, i])[1] for x in (signals.phi, signals.theta, signals.tau)]
                columns.append(self.of_signals(i, *rates))
                columns.append(self.of_signals(i, *(rate * middle[:, None] for rate in rates)))
        return np.stack(columns, axis=2) if columns else np.zeros((*self.residual.shape, 0))

    @property
    def by_odometry(self) -> Array:
        """Derivative by constants of driving bases, shape (n, C, 5 N): errors of scale in yaw, x and y, and tilt by
        acceleration and by the moment of the load, as in ``estimator.calibrate.driven``."""
        if self.signals.base is None:
            return np.zeros((*self.residual.shape, 0))
        Q, N = self.s.shape[:2]
        errors = np.zeros((Q, N, 6, N, SCALES))
        paths = scaled_paths(self.s[..., COUNT:], self.signals.rate_hz)
        for i in range(N):
            errors[:, i, 3:5, i, :3] = np.moveaxis(paths[:, i, :3, :2], 1, 2)
            errors[:, i, 2, i, :3] = paths[:, i, :3, 2]
            ahead = self.s[:, i, COUNT + 6 : COUNT + 8]
            errors[:, i, 0, i, 3], errors[:, i, 1, i, 3] = -ahead[:, 1], ahead[:, 0]
            R, force = self.data.R_bi[:, i], self.data.wrench[:, i, 3:]
            moment = np.cross(self._lever(i), -np.einsum("qij,qj->qi", R, force))
            errors[:, i, :2, i, 4] = moment[:, :2]
        return self.of_bases(errors.reshape(Q, N, 6, -1))

    def _lever(self, robot: int) -> Array:
        """Wrist from the base's place on the floor, shape (Q, 3) [m]."""
        place = self.s[:, robot, COUNT : COUNT + 3] * [1.0, 1.0, 0.0]
        return self.data.p_bi[:, robot] - place - [0.0, 0.0, FLOOR_M]

    def of_bases(self, errors: Array) -> Array:
        """Residual rows of a change of the bases' poses, shape (n, C, k).

        Args:
            errors: rotation [rad] and displacement [m] of every base about its place on the floor, in its {b} at the
                start, shape (Q, N, 6, k).
        """
        Q, N, _, k = errors.shape
        out, shared = np.zeros((Q, self.channels, k)), self.shared
        for i in range(N):
            turn, lever = errors[:, i, :3], self._lever(i)
            shift = errors[:, i, 3:] + np.cross(turn, lever[..., None], axis=1)
            for j in range(1, N):
                about, along = _channels(j)
                if i == 0:
                    grasp = self.data.R_bi[:, 0] @ shared.grasps.p_1i[j]
                    out[:, about] -= turn
                    out[:, along] -= shift + np.cross(turn, grasp[..., None], axis=1)
                elif i == j:
                    out[:, about] += self.bases.R[i] @ turn
                    out[:, along] += self.bases.R[i] @ shift
            out[:, -6:] += self._of_wrong_motion(i, self.bases.R[i] @ shift, slice(None))
            up = np.cross(turn, [0.0, 0.0, 1.0], axisa=1, axisc=1)
            up = shared.grasps.R_1i[i] @ np.swapaxes(self.data.R_bi[:, i], 1, 2) @ up
            weight = self.data.gravity_mps2 / N * up
            out[:, -6:-3] += shared.pi[0] * weight
            out[:, -3:] += skew(shared.pi[1:4]) @ weight
        return self.reduction(out)

    @cached_property
    def by_wrist(self) -> NDArray[np.float32]:
        """Derivative of the wrench balance by velocity and acceleration of a wrist in {b_i}, shape (N, Q, 6, 6).

        It only includes the payload's motion, which is fused from all wrists, because the arm itself does move that
        way. Single precision saves memory.
        """
        samples, G = len(self.s), fusion_matrix(self.shared.grasps)
        motion = self.data.twist.reshape(samples, -1) @ G.T
        out = np.zeros((self.robots, samples, 6, 6), np.float32)
        for i in range(self.robots):
            at = slice(6 * i + 3, 6 * i + 6)
            omega = self.data.twist[:, i, :3]
            for k in range(3):
                along = self.data.R_bi[:, i, k]  # unit vector k of {b_i}, in {i}
                none, turned = np.zeros_like(along), -np.cross(omega, along)
                for column, (v, v_dot) in ((k, (along, turned)), (3 + k, (none, along))):
                    needed = needed_wrench(motion, v @ G[:, at].T, v_dot @ G[:, at].T, none, self.shared.pi)
                    out[i, :, :, column] = -np.concatenate(needed, axis=1)
        return stored(out) if is_stored(self.s) else out


def linearise(
    signals: Signals,
    shared: Shared,
    bases: Bases,
    arms: Arms,
    reduction: Reduction,
    *,
    full: bool,
    known: bool = False,
) -> TrialLinear:
    """Linearise one trial.

    Args:
        signals: of the trial.
        shared, bases, arms: linearisation point.
        reduction: samples to rows.
        full: whether to compute the derivatives by the robots' signals; J is empty otherwise.
        known: whether the shared unknowns are fixed; ``by_shared`` then has no columns.
    """
    s = filtered(signals)
    data = grasp_data(s, arms, signals.rate_hz)
    pose = pose_residual(signals.phi, signals.theta, shared, bases, arms, signals.base)
    residual = reduction(np.concatenate([pose, balance(data, shared)[0]], axis=1))
    moved = np.zeros((*residual.shape, 0)) if known else reduction(by_shared(data, shared, bases))
    columns = moved, reduction(by_bases(data, shared, bases))
    J = BySignals.none(s.shape[1], 6 * s.shape[1])
    out = TrialLinear(signals, s, data, shared, bases, arms, reduction, residual, J, *columns)
    return with_derivatives(out) if full else out


def with_derivatives(trial: TrialLinear) -> TrialLinear:
    """Add the derivatives by the robots' signals to a trial."""
    s, data, signals = trial.s, trial.data, trial.signals
    if signals.chatters:  # chatter would alias in J, which is interpolated between knots
        s = filtered(replace(signals, pre_hz=CHATTER_JACOBIAN_HZ))
        data = grasp_data(s, trial.arms, signals.rate_hz)
    return replace(trial, J=by_signals(s, data, trial.shared, trial.bases, trial.arms))


def filtered(signals: Signals) -> Array:
    """Filter the signals and arrange them in the slots of ``estimator.arm.motion``, shape (Q, N, 21).

    Pose, rate and acceleration of driving bases follow, shape (Q, N, 30).
    """
    Q, N = signals.phi.shape[:2]
    angles = signals.with_rates(signals.phi), signals.with_rates(signals.theta)
    base = [] if signals.base is None else [signals.with_rates(signals.base)]
    parts = np.concatenate([*angles, signals.with_rates(signals.tau)[:1], *base])
    return parts.transpose(1, 2, 0, 3).reshape(Q, N, -1)
