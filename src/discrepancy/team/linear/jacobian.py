"""Derivative of a trial's residual by every robot's signals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimator.arm.motion import COUNT, PHI, STEPS, THETA, ArmData, arm_data, yaw_matrix
from estimator.arm.unit import Arms, arm_of, levelled
from estimator.arrays import Array
from estimator.rigid_team import Bases, Shared, fuse, fusion_matrix, needed_wrench, vee
from estimator.signals import GraspData
from estimator.so3 import cross, times

TEAM_JACOBIAN_HZ = 25.0
"""Rate of the knots between which derivatives are interpolated [Hz]. Chosen: twice that of the rows."""


@dataclass(frozen=True, eq=False)
class BySignals:
    """Derivative of the residual's samples by every robot's signals, (Q, C, 21) each, stored at knots.

    It changes as slowly as the motion, so linear interpolation is accurate to 1e-3 and single precision suffices. A
    robot affects its own loop and the wrench balance (robot 1 all loops). Only these channels are stored.

    Attributes:
        knots: derivatives for every robot, shape (K, channels that it affects, 21).
        moved: indices of these channels, for every robot.
        channels: C.
        every: samples from one knot to the next.
        samples: Q.
    """

    knots: tuple[NDArray[np.float32], ...]
    moved: tuple[NDArray[np.intp], ...]
    channels: int
    every: int
    samples: int

    @classmethod
    def none(cls, robots: int, channels: int) -> BySignals:
        """Make an empty placeholder, for callers that need no derivatives."""
        empty = np.zeros((0, 0, COUNT), np.float32)
        return cls((empty,) * robots, (np.zeros(0, np.intp),) * robots, channels, 1, 0)

    def __call__(self, robot: int, slots: slice, change: Array) -> Array:
        """Multiply the derivative by changes of one robot's signals, (Q, s) -> (Q, C), or (Q, s, k) -> (Q, C, k).

        A constant change has shape (s,).
        """
        J = self.knots[robot][..., slots].astype(np.float64)
        after = np.concatenate([J[1:], J[-1:]])
        if change.ndim == 1:
            change = np.broadcast_to(change, (self.samples, len(change)))
        several = change.shape[2:]
        each = np.zeros((len(J) * self.every, change.shape[1], *several))
        each[: self.samples] = change
        each = np.moveaxis(each.reshape(len(J), self.every, change.shape[1], -1), 1, 3)  # (K, s, k, every)
        weight = np.arange(self.every) / self.every
        rows, parts = J.shape[1], each.shape[2]
        out = J @ (each * (1.0 - weight)).reshape(len(J), -1, parts * self.every)
        out += after @ (each * weight).reshape(len(J), -1, parts * self.every)
        out = np.moveaxis(out.reshape(len(J), rows, parts, self.every), 3, 1)
        whole = np.zeros((self.samples, self.channels, *several))
        whole[:, self.moved[robot]] = out.reshape(-1, rows, *several)[: self.samples]
        return whole

    def at(self, robot: int, slots: slice, samples: NDArray[np.intp]) -> Array:
        """Derivative by one robot's signals at some samples, shape (k,) -> (k, C, s)."""
        J = self.knots[robot][..., slots].astype(np.float64)
        low, rest = np.divmod(samples, self.every)
        after = J[np.minimum(low + 1, len(J) - 1)]
        whole = np.zeros((len(samples), self.channels, J.shape[2]))
        whole[:, self.moved[robot]] = J[low] + (after - J[low]) * (rest / self.every)[:, None, None]
        return whole


def by_signals(s: Array, data: GraspData, shared: Shared, bases: Bases, arms: Arms) -> BySignals:
    """Compute the derivative of the residual by every robot's signals, at 25 Hz.

    Central differences give the derivative of one robot's own formulas. The rest is linear in the robots and analytic.
    """
    samples, every = len(s), max(1, round(data.rate_hz / TEAM_JACOBIAN_HZ))
    knots = np.arange(0, samples, every)
    s = s[knots]
    data = _thinned(data, knots)
    Q, N = s.shape[:2]
    grasps = shared.grasps
    motion = fuse(data, grasps)
    fused = data.twist.reshape(Q, -1) @ fusion_matrix(grasps).T
    knots_of, moved = [], []
    for i in range(N):
        J = np.zeros((Q, 6 * N, COUNT))
        G = fusion_matrix(grasps)[:, 6 * i : 6 * i + 6]
        R_1i, p_1i = grasps.R_1i[i], grasps.p_1i[i]
        dR, dh, dV, dV_dot, dF = _changes(s[:, i, :COUNT], arm_of(arms, i))  # (21, Q, ...)
        if s.shape[2] > COUNT:
            turned = yaw_matrix(s[:, i, COUNT + 2])
            dR, dh = turned @ dR, times(turned, dh)
        turn = vee(dR @ np.swapaxes(data.R_bi[:, i], -1, -2))  # in {b_i}
        for j in range(1, N):
            at = 6 * (j - 1)
            if i == 0:
                J[:, at : at + 3] = np.moveaxis(-turn, 0, -1)
                J[:, at + 3 : at + 6] = np.moveaxis(-dh - dR @ grasps.p_1i[j], 0, -1)
            elif i == j:
                J[:, at : at + 3] = np.moveaxis(turn @ bases.R[j].T, 0, -1)
                J[:, at + 3 : at + 6] = np.moveaxis(dh @ bases.R[j].T, 0, -1)
        d_up = dR[..., 2, :] @ R_1i.T / N
        d_up -= np.sum(d_up * motion.up, axis=-1, keepdims=True) * motion.up
        needed = needed_wrench(fused, dV @ G.T, dV_dot @ G.T, data.gravity_mps2 * d_up, shared.pi)
        d_force, d_moment = dF[..., 3:] @ R_1i.T, dF[..., :3] @ R_1i.T
        d_moment = d_moment + cross(p_1i, d_force)
        J[:, -6:-3] = np.moveaxis(d_force - needed[0], 0, -1)
        J[:, -3:] = np.moveaxis(d_moment - needed[1], 0, -1)
        own = np.arange(6 * (N - 1)) if i == 0 else np.arange(6 * (i - 1), 6 * i)
        moved.append(np.concatenate([own, np.arange(6 * (N - 1), 6 * N)]))
        knots_of.append(J[:, moved[i]].astype(np.float32))
    return BySignals(tuple(knots_of), tuple(moved), 6 * N, every, samples)


def _changes(s: Array, arm: Arms) -> ArmData:
    """Derivative of one robot's data by its signals, (Q, 21) -> (21, Q, ...) each.

    All signals of one kind are differenced at once. Where angles stay, the leg geometry and the orientation are reused.
    """
    Q, kinds = len(s), COUNT // 3
    at = list(np.moveaxis(s.reshape(Q, kinds, 3), 1, 0))
    fields = [np.zeros((COUNT, Q, *size)) for size in ((3, 3), (3,), (6,), (6,), (6,))]
    phi, theta = PHI.start // 3, THETA.start // 3
    for some in ((phi,), (theta,), tuple(k for k in range(kinds) if k not in (phi, theta))):
        slots = np.concatenate([np.arange(3 * k, 3 * k + 3) for k in some])
        steps, ends = STEPS[slots], []
        for sign in (1.0, -1.0):
            moved = [
                x if k in (phi, theta) else np.broadcast_to(x, (len(slots), Q, 3)) for k, x in enumerate(at)
            ]
            for n, k in enumerate(some):
                change = np.zeros((len(slots), 1, 3))
                change[3 * n : 3 * n + 3, 0] = sign * np.diag(STEPS[3 * k : 3 * k + 3])
                moved[k] = at[k] + change
            data = arm_data((moved[0], moved[1], moved[2]), (moved[3], moved[4], moved[5]), moved[6], arm)
            R_bi, h = levelled(arm, data.R_bi, data.h)
            ends.append(data._replace(R_bi=R_bi, h=h))
        for field, ahead, behind in zip(fields, *ends, strict=True):
            if ahead.ndim == field.ndim:
                field[slots] = (ahead - behind) / (2.0 * steps.reshape(-1, *[1] * (field.ndim - 1)))
    return ArmData(*fields)


def _thinned(data: GraspData, rows: NDArray[np.intp]) -> GraspData:
    arrays = {f: getattr(data, f)[rows] for f in ("time", "R_bi", "p_bi", "twist", "twist_dot", "wrench")}
    return GraspData(**arrays, rate_hz=data.rate_hz, gravity_mps2=data.gravity_mps2)
