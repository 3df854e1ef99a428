"""Robots that hold two bodies: grasps, the joint between the bodies, bases, and the equations that follow.

Body A is the one that robot 1 holds, and {A} is its grasp frame {1}. Body B has the grasp frame of its first robot as
{B}. The pose of {B} in {A} at the joint coordinate q is, with rotations about the axis a through the pivot c,

    hinged:  R = exp(q a) R_0,  p = c + exp(q a) (p_0 - c)        sliding:  R = R_0,  p = p_0 + q a

The joint frame {J} is fixed in B. Its axes are a and two normals, and its origin is the pivot (sliding: the origin of
{B}). Robots are held as designed or calibrated.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from estimator.arm.motion import ArmData
from estimator.arrays import Array
from estimator.estimate.grasps import GraspEstimate
from estimator.rigid_team import (
    Bases,
    fused_up,
    fusion_with,
    newton_euler_regressor,
    total_wrench,
    vee,
)
from estimator.so3 import cross, skew, times

Motion = Literal["rigid", "hinged", "sliding", "loose"]
"""How body B moves against A: not at all, about a line, along a line, or freely in all six coordinates."""
Law = tuple[str, ...]
"""Names of the terms of the joint's generalized force, from ``TERMS``."""
TERMS = ("damping", "friction", "stiffness", "offset")
SPEED = {"hinged": 0.01, "sliding": 0.003}
"""Joint speed [rad/s, m/s] that smooths the sign of Coulomb friction. Chosen: ten times the noise of that speed."""
KEPT = {
    # The columns of B about {J}: (m, m c, Jxx, Jxy, Jxz, Jyy, Jyz, Jzz), x along the axis.
    "hinged": ((2,), (3,), (4,), (5,), (6,), (8,), (7, 9)),
    "sliding": ((0,), (1,), (2,), (3,)),
}
"""Parameters of B that the motion distinguishes from those of A. A point mass on a hinge's line belongs to either body:
three of B's ten parameters (m, m c_x, Jyy + Jzz) stand with A. Sliding bodies turn together: all inertia stands with A.
The pair (7, 9) is Jyy = -Jzz."""
NAMES = {
    "hinged": ("mc_y", "mc_z", "J_xx", "J_xy", "J_xz", "J_yz", "J_yy_minus_J_zz"),
    "sliding": ("m", "mc_x", "mc_y", "mc_z"),
}
"""Names of these parameters; the last one of a hinge is (Jyy - Jzz) / 2."""


def expand(motion: str) -> Array:
    """Return the matrix from the parameters ``NAMES`` to the ten of B about {J}, shape (10, K)."""
    out = np.zeros((10, len(KEPT[motion])))
    for column, places in enumerate(KEPT[motion]):
        out[places[0], column] = 1.0
        out[places[1:], column] = -1.0
    return out


class Coordinates(NamedTuple):
    """Joint coordinate q [rad, m], shape (Q,), and the five (rigid, loose: six) residuals of the joint, (Q, 5)."""

    q: Array
    left: Array


@dataclass(frozen=True, eq=False)
class Joint:
    """The joint; ``axes`` has the columns (a, n_1, n_2). All of it is in {A}: R_0 (3, 3), p_0, pivot (3,)."""

    motion: Motion
    R_0: Array
    p_0: Array
    axes: Array
    pivot: Array

    @property
    def size(self) -> int:
        """Number of unknowns of ``moved``."""
        return {"rigid": 6, "loose": 6, "hinged": 9, "sliding": 7}[self.motion]

    def moved(self, x: Array) -> Joint:
        """Change the unknowns: R_0 and p_0 except along the motion, then axis and pivot across the axis."""
        N = self.axes
        if self.motion in ("rigid", "loose"):
            return replace(self, R_0=_exp(x[:3]) @ self.R_0, p_0=self.p_0 + x[3:])
        if self.motion == "hinged":
            turn, pivot = N[:, 1:] @ x[5:7], self.pivot + N[:, 1:] @ x[7:9]
            return replace(
                self, R_0=_exp(N[:, 1:] @ x[:2]) @ self.R_0, p_0=self.p_0 + x[2:5], axes=_exp(turn) @ N, pivot=pivot
            )  # fmt: skip
        turn = N[:, 1:] @ x[5:7]
        return replace(
            self, R_0=_exp(x[:3]) @ self.R_0, p_0=self.p_0 + N[:, 1:] @ x[3:5], axes=_exp(turn) @ N
        )

    def coordinates(self, R: Array, p: Array) -> Coordinates:
        """Split poses of {B} in {A}, (Q, 3, 3) and (Q, 3), into the joint coordinate and what the joint forbids."""
        a, across = self.axes[:, 0], self.axes[:, 1:]
        rel = R @ self.R_0.T
        if self.motion == "hinged":
            # The turn about a that is nearest to rel.
            q = np.arctan2(
                2.0 * vee(rel) @ a, np.trace(rel, axis1=1, axis2=2) - np.einsum("i,qij,j->q", a, rel, a)
            )
            turn = Rotation.from_rotvec(q[:, None] * a).as_matrix()
            off = p - self.pivot - turn @ (self.p_0 - self.pivot)
            return Coordinates(q, np.concatenate([vee(np.swapaxes(turn, 1, 2) @ rel) @ across, off], axis=1))
        d = p - self.p_0
        if self.motion == "sliding":
            return Coordinates(d @ a, np.concatenate([vee(rel), d @ across], axis=1))
        return Coordinates(np.zeros(len(p)), np.concatenate([vee(rel), d], axis=1))

    @property
    def frame(self) -> tuple[Array, Array]:
        """Rotation and origin of {J} in {B}."""
        origin = self.R_0.T @ (self.pivot - self.p_0) if self.motion == "hinged" else np.zeros(3)
        return self.R_0.T @ self.axes, origin

    def at(self, q: float) -> tuple[Array, Array]:
        """Pose of {J} in {A} at the coordinate q."""
        if self.motion == "hinged":
            return _exp(q * self.axes[:, 0]) @ self.axes, self.pivot
        return self.axes, self.p_0 + q * self.axes[:, 0]


@dataclass(frozen=True, eq=False)
class Pair:
    """Unknowns of two bodies in the hands of N robots, except inertial parameters.

    Attributes:
        halves: indices (from 0) of the robots that hold A and B; robot 0 is the first of A.
        R, p: grasp frames in the frame of the body, shapes (N, 3, 3) and (N, 3); those of both first robots are fixed.
        joint: the joint.
        bases: poses of all bases in that of robot 1, for each trial.
    """

    halves: tuple[tuple[int, ...], tuple[int, ...]]
    R: Array
    p: Array
    joint: Joint
    bases: tuple[Bases, ...]

    @property
    def others(self) -> list[int]:
        """Robots whose grasp frame is unknown."""
        return [*self.halves[0][1:], *self.halves[1][1:]]

    @property
    def size(self) -> int:
        """Number of unknowns: grasps (6 each), joint, bases (4 each in every trial)."""
        return 6 * len(self.others) + self.joint.size + 4 * (len(self.p) - 1) * len(self.bases)

    @property
    def of_joint(self) -> slice:
        """Slice of the joint's unknowns."""
        start = 6 * len(self.others)
        return slice(start, start + self.joint.size)

    def seen_by(self, trial: int) -> list[int]:
        """Unknowns that a trial depends on: all but the bases of other trials."""
        each, start = 4 * (len(self.p) - 1), self.of_joint.stop
        return [*range(start), *range(start + each * trial, start + each * (trial + 1))]

    def moved(self, x: Array) -> Pair:
        """Change all unknowns, shape (size,)."""
        R, p, at = self.R.copy(), self.p.copy(), self.of_joint
        for k, i in enumerate(self.others):
            R[i], p[i] = _exp(x[6 * k : 6 * k + 3]) @ R[i], p[i] + x[6 * k + 3 : 6 * k + 6]
        parts = np.split(x[at.stop :], len(self.bases))
        bases = tuple(base.moved(part) for base, part in zip(self.bases, parts, strict=True))
        return Pair(self.halves, R, p, self.joint.moved(x[at]), bases)

    def grasps(self, half: int) -> GraspEstimate:
        """Grasps of the robots of one half, without errors."""
        at = list(self.halves[half])
        none = np.zeros((len(at), len(at)))
        six = np.zeros((6 * len(at) - 6,) * 2)
        return GraspEstimate(self.R[at], self.p[at], six, none, none, np.zeros(len(at)), np.zeros(len(at)))

    def loops(self, R_bi: Array, h: Array, bases: Bases) -> tuple[Array, Coordinates, tuple[Array, Array]]:
        """Return residuals of the loops within the halves, the joint's coordinates, and the pose of {B} in {A}.

        Args:
            R_bi, h: poses of the grasps in level base frames, shapes (Q, N, 3, 3) and (Q, N, 3).
            bases: base poses of this trial.
        """
        R = bases.R @ R_bi
        p = bases.p + (bases.R @ h[..., None])[..., 0]
        parts = []
        for first, *rest in self.halves:
            for i in rest:
                back = R[:, first] @ self.R[i]
                parts.append(vee(R[:, i] @ np.swapaxes(back, 1, 2)))
                parts.append(p[:, i] - p[:, first] - R[:, first] @ self.p[i])
        b = self.halves[1][0]
        R_A = np.swapaxes(R[:, 0], 1, 2)
        pose = R_A @ R[:, b], times(R_A, p[:, b] - p[:, 0])
        left = np.concatenate(parts, axis=1) if parts else np.zeros((len(h), 0))
        return left, self.joint.coordinates(*pose), pose


class Balance(NamedTuple):
    """Balance of wrenches at Q instants: the residual is ``wrench - columns @ pi``.

    Attributes:
        wrench: force and moment of all robots on both bodies about the origin of {A}, in {A}, and the generalized
            force of B's robots along the joint, shape (Q, 7).
        columns: by the ten parameters of A (about {A}), those of B (``NAMES``), and the terms of the law, (Q, 7, K).
        stick: share of the friction that is unknown because the joint hardly moves, shape (Q,).
    """

    wrench: Array
    columns: Array
    stick: Array


def balance(
    pair: Pair, data: ArmData, pose: tuple[Array, Array], q: Array, law: Law, gravity: float
) -> Balance:
    """Return the balance of both bodies, from the robots' data, the pose of {B} in {A} and the joint coordinate.

    The generalized force of the joint on B is -(damping q_dot + friction sign(q_dot) + stiffness q - offset).
    """
    motion = pair.joint.motion
    w_A, v_A, alpha_A, G_A, f_A, m_A = _body(pair, 0, data, (np.eye(3), np.zeros(3)), gravity)
    R_BJ, p_BJ = pair.joint.frame
    w_B, v_B, alpha_B, G_B, f_B, m_B = _body(pair, 1, data, (R_BJ, p_BJ), gravity)
    R, p = pose[0] @ R_BJ, pose[1] + pose[0] @ p_BJ  # {J} in {A}
    Y_A = newton_euler_regressor(w_A, alpha_A, G_A)
    Y_B = newton_euler_regressor(w_B, alpha_B, G_B) @ expand(motion)
    turned, along = R @ Y_B[:, :3], 3 if motion == "hinged" else 0
    moved = R @ Y_B[:, 3:] + skew(p) @ turned
    force, moment = times(R, f_B), times(R, m_B)
    back = np.swapaxes(R, 1, 2)
    if motion == "hinged":
        speed = w_B[:, 0] - times(back, w_A)[:, 0]
    else:
        speed = v_B[:, 0] - times(back, v_A + cross(w_A, p))[:, 0]
    sign = np.tanh(speed / SPEED[motion])
    terms = {"damping": speed, "friction": sign, "stiffness": q, "offset": -np.ones(len(q))}
    n = 10 + Y_B.shape[2]
    columns = np.zeros((len(q), 7, n + len(law)))
    columns[:, :6, :10] = Y_A
    columns[:, :3, 10:n], columns[:, 3:6, 10:n] = turned, moved
    columns[:, 6, 10:n] = Y_B[:, along]
    for k, term in enumerate(law):
        columns[:, 6, n + k] = terms[term]
    total = np.concatenate([f_A + force, m_A + moment + cross(p, force)], axis=1)
    own = (m_B if motion == "hinged" else f_B)[:, :1]
    return Balance(np.concatenate([total, own], axis=1), columns, 1.0 - sign**2)


def _body(
    pair: Pair, half: int, data: ArmData, frame: tuple[Array, Array], gravity: float
) -> tuple[Array, Array, Array, Array, Array, Array]:
    """Return omega, v, alpha, specific force, and the robots' force and moment, in a frame fixed in one body."""
    at, grasps = list(pair.halves[half]), pair.grasps(half)
    R, p = frame
    G = fusion_with(grasps, 2.0)
    V, V_dot = (part[:, at].reshape(len(part), -1) @ G.T for part in (data.twist, data.twist_dot))
    w, alpha = V[:, :3], V_dot[:, :3]
    v, v_dot = V[:, 3:] + cross(w, p), V_dot[:, 3:] + cross(alpha, p)
    force, moment = total_wrench(data.wrench[:, at], grasps)
    moment = moment - cross(p, force)
    up = fused_up(data.R_bi[:, at], grasps)
    specific = v_dot + cross(w, v) + gravity * up
    w, v, alpha, specific, force, moment = (x @ R for x in (w, v, alpha, specific, force, moment))
    return w, v, alpha, specific, force, moment


def _exp(rotvec: Array) -> Array:
    return Rotation.from_rotvec(rotvec).as_matrix()


def halves_of(robots: int) -> list[tuple[tuple[int, ...], tuple[int, ...]]]:
    """Return all ways to divide N robots into two halves, robot 0 in the first."""
    out = []
    for mask in range(1, 2 ** (robots - 1)):
        B = tuple(i for i in range(1, robots) if mask >> (i - 1) & 1)
        out.append((tuple(i for i in range(robots) if i not in B), B))
    return out
