"""Rigid-body mechanics of a tree of revolute and prismatic joints, vectorised over the samples of a log."""

from __future__ import annotations

import copy
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any

# mujoco's compiled modules come without types.
# pyright: reportAttributeAccessIssue=false
import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from estimator.arrays import Array, point_inertia
from estimator.errors import InputError


@dataclass(frozen=True, eq=False)
class Coupling:
    """How N joints of a model move with the J joints that move on their own; the others follow them linearly.

    Attributes:
        own: the J joints, shape (J,).
        ratio, offset: positions of all joints are ``ratio @ q + offset``, shapes (N, J) and (N,).
    """

    own: NDArray[np.intp]
    ratio: Array
    offset: Array

    @classmethod
    def of(cls, model: mujoco.MjModel) -> Coupling:
        """Read the linear equality constraints between joints of a model of hinges and slides.

        Raises:
            InputError: joints follow each other in a circle.
        """
        N = model.njnt
        ratio, offset, leads = np.eye(N), np.zeros(N), np.ones(N, dtype=bool)
        for e in range(model.neq):
            if model.eq_type[e] == mujoco.mjtEq.mjEQ_JOINT and model.eq_active0[e]:
                f, leader = int(model.eq_obj1id[e]), int(model.eq_obj2id[e])
                leads[f], ratio[f] = False, 0.0
                offset[f] = model.qpos0[f] + model.eq_data[e, 0]
                if leader >= 0:
                    ratio[f, leader] = model.eq_data[e, 1]
                    offset[f] -= model.eq_data[e, 1] * model.qpos0[leader]
        own, step, shift = np.flatnonzero(leads), ratio, offset
        for _ in range(N):  # a follower may lead another
            if not ratio[:, ~leads].any():
                return cls(own, ratio[:, own], offset)
            ratio, offset = ratio @ step, ratio @ shift + offset
        names = ", ".join(model.joint(int(j)).name for j in np.flatnonzero(ratio[:, ~leads].any(axis=1)))
        raise InputError(f"joints follow each other in a circle ({names}); delete an equality constraint")

    def all(self, q: Array, *rates: Array) -> list[Array]:
        """Positions of all joints, and their derivatives, from those of the J joints, (..., J) -> (..., N) each."""
        return [q @ self.ratio.T + self.offset, *(x @ self.ratio.T for x in rates)]

    def driven(self, torque: Array) -> Array:
        """Torques at the J joints that do the work of those at all joints, shape (Q, N, ...) -> (Q, J, ...)."""
        if len(self.own) == len(self.ratio):
            return torque
        return np.moveaxis(np.tensordot(torque, self.ratio, axes=(1, 0)), -1, 1)


@dataclass(frozen=True, eq=False)
class Tree:
    """Kinematic tree of B bodies and N joints; parents come before children, and body 0 is the world.

    The J joints that move on their own come first; the others follow them.

    Attributes:
        parent: parent of each body, shape (B,).
        position, rotation: pose of each body frame in its parent frame at joint position ``zero``, shapes (B, 3) and
            (B, 3, 3).
        joint_body: body that each joint moves, shape (N,).
        slides: whether a joint is prismatic, shape (N,).
        anchor, axis: a point on the joint axis and its direction, in the frame of its body, shape (N, 3) each.
        zero: joint position at which the poses hold, shape (N,).
        mass: shape (B,) [kg].
        com: centres of mass in body frames, shape (B, 3) [m].
        inertia: about the centres of mass in body axes, shape (B, 3, 3) [kg m^2].
        gravity: in the world frame, shape (3,) [m/s^2].
        armature: reflected rotor inertia, shape (J,).
        coulomb, viscous: Coulomb friction [N m or N] and damping [N m s/rad or N s/m], shape (J,) each.
        drag: damping of second and third degree in the speed, as of MJCF's ``damping``, shape (J, 2).
        coupling: how the N joints move with the J joints.
    """

    parent: NDArray[np.intp]
    position: Array
    rotation: Array
    joint_body: NDArray[np.intp]
    slides: NDArray[np.bool_]
    anchor: Array
    axis: Array
    zero: Array
    mass: Array
    com: Array
    inertia: Array
    gravity: Array
    armature: Array
    coulomb: Array
    viscous: Array
    drag: Array
    coupling: Coupling

    @classmethod
    def of(cls, model: Any) -> Tree:
        """Build from a compiled ``mujoco.MjModel`` of hinge and slide joints."""
        own, c = _rotations(model.body_iquat), Coupling.of(model)
        order = np.append(c.own, np.setdiff1d(np.arange(model.njnt), c.own))
        size = np.abs(c.ratio)
        return cls(
            parent=np.asarray(model.body_parentid, dtype=np.intp),
            position=np.array(model.body_pos),
            rotation=_rotations(model.body_quat),
            joint_body=np.asarray(model.jnt_bodyid, dtype=np.intp)[order],
            slides=np.asarray(model.jnt_type)[order] == 2,  # mjJNT_SLIDE
            anchor=np.array(model.jnt_pos)[order],
            axis=np.array(model.jnt_axis)[order],
            zero=np.array(model.qpos0)[order],
            mass=np.array(model.body_mass),
            com=np.array(model.body_ipos),
            inertia=own @ (model.body_inertia[:, :, None] * own.swapaxes(1, 2)),
            gravity=np.array(model.opt.gravity),
            armature=model.dof_armature @ size**2,
            coulomb=model.dof_frictionloss @ size,
            viscous=model.dof_damping @ size**2,
            drag=np.column_stack([model.dof_dampingpoly[:, k] @ size ** (3 + k) for k in range(2)]),
            coupling=replace(c, own=np.arange(len(c.own)), ratio=c.ratio[order], offset=c.offset[order]),
        )

    @property
    def moved(self) -> NDArray[np.bool_]:
        """Whether a joint moves a body, shape (N, B)."""
        out = np.zeros((len(self.joint_body), len(self.parent)), dtype=bool)
        for b in range(1, len(self.parent)):
            out[:, b] = out[:, self.parent[b]] | (self.joint_body == b)
        return out

    @property
    def last_link(self) -> int:
        """The joint farthest from the base, counted in joints."""
        ways = self.moved[:, self.joint_body].sum(axis=0)
        return int(np.flatnonzero(ways == ways.max())[-1])

    @property
    def links(self) -> NDArray[np.intp]:
        """Moving bodies with mass: only these have observable inertial parameters."""
        return np.flatnonzero(self.moved.any(axis=0) & (self.mass > 0))


def _rotations(quaternions: Array) -> Array:
    """Convert quaternions (w, x, y, z) to rotation matrices, shape (B, 4) -> (B, 3, 3)."""
    return np.asarray(Rotation.from_quat(quaternions, scalar_first=True).as_matrix())


@dataclass(frozen=True, eq=False)
class Motion:
    """Motion of all bodies at Q samples; vectors in world axes, for the origins of the body frames.

    Attributes:
        tree: the kinematic tree.
        rotation: orientation of each body in the world, shape (B, Q, 3, 3).
        origin: shape (B, Q, 3) [m].
        omega, alpha: angular velocity and acceleration, shape (B, Q, 3).
        acceleration: acceleration of the origins minus gravity, shape (B, Q, 3) [m/s^2].
        axis, anchor: of each joint, shape (N, Q, 3).
        known: cache of ``body_regressor`` by body, and of ``rigid_torque`` under None.
    """

    tree: Tree
    rotation: Array
    origin: Array
    omega: Array
    alpha: Array
    acceleration: Array
    axis: Array
    anchor: Array
    known: dict[int | None, Array] = field(default_factory=dict, repr=False)

    @classmethod
    def of(cls, tree: Tree, q: Array, dq: Array, ddq: Array) -> Motion:
        """Forward kinematics from joint positions, velocities and accelerations, shape (Q, J) each."""
        Q, B, J = len(q), len(tree.parent), len(tree.joint_body)
        q, dq, ddq = tree.coupling.all(q, dq, ddq)
        R = np.moveaxis(np.zeros((B, 3, 3, Q)), -1, 1)
        p, w, al, a = (vectors(B, Q) for _ in range(4))
        axis, anchor = vectors(J, Q), vectors(J, Q)
        R[0], a[0] = np.eye(3), -tree.gravity
        for b in range(1, B):
            up = tree.parent[b]
            lever = turned(R[up], tree.position[b])
            Rb, pb = turned_frame(R[up], tree.rotation[b]), p[up] + lever
            wb, alb, ab = w[up], al[up], a[up] + rigid(w[up], al[up], lever)
            for j in np.flatnonzero(tree.joint_body == b):
                s, to = turned(Rb, tree.axis[j]), turned(Rb, tree.anchor[j])
                axis[j], anchor[j] = s, pb + to
                rate, turn = s * dq[:, j, None], q[:, j] - tree.zero[j]
                if tree.slides[j]:
                    shift = s * turn[:, None]
                    ab = ab + rigid(wb, alb, shift) + 2.0 * cross(wb, rate) + s * ddq[:, j, None]
                    pb = pb + shift
                    continue
                off = tree.anchor[j].any()  # most body frames lie on the joint axis
                ab = ab + rigid(wb, alb, to) if off else ab
                alb = alb + s * ddq[:, j, None] + cross(wb, rate)
                wb = wb + rate
                Rb = _about(Rb, tree.axis[j], turn)
                if off:
                    back = -turned(Rb, tree.anchor[j])
                    pb, ab = anchor[j] + back, ab + rigid(wb, alb, back)
            R[b], p[b], w[b], al[b], a[b] = Rb, pb, wb, alb, ab
        return cls(tree, R, p, w, al, a, axis, anchor)


def rigid(omega: Array, alpha: Array, lever: Array) -> Array:
    """Acceleration of a point relative to another on the same body: alpha x r + omega x (omega x r), shape (Q, 3)."""
    return cross(alpha, lever) + cross(omega, cross(omega, lever))


def vectors(*shape: int) -> Array:
    """Zero vectors, shape (..., Q, 3), with contiguous samples of each component for speed."""
    return np.swapaxes(np.zeros((*shape[:-1], 3, shape[-1])), -1, -2)


def cross(a: Array, b: Array) -> Array:
    """Cross product along the last axis; faster than ``numpy.cross``."""
    out = np.empty((3, *np.broadcast_shapes(a.shape, b.shape)[:-1]))
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        np.multiply(a[..., i], b[..., j], out=out[k])
        out[k] -= a[..., j] * b[..., i]
    return np.moveaxis(out, 0, -1)


def dot(a: Array, b: Array) -> Array:
    """Scalar product along the last axis."""
    return a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]


def turned(R: Array, v: Array) -> Array:
    """Product R v, shapes (Q, 3, 3) and (Q, 3) or (3,) -> (Q, 3)."""
    out = np.empty((3, len(R)))
    for i in range(3):
        np.multiply(R[:, i, 0], v[..., 0], out=out[i])
        out[i] += R[:, i, 1] * v[..., 1]
        out[i] += R[:, i, 2] * v[..., 2]
    return out.T


def times(C: Array, v: Array) -> Array:
    """Product C v with a constant C, shapes (3, 3) and (Q, 3) -> (Q, 3)."""
    return (C @ v.T).T


def turned_frame(R: Array, C: Array) -> Array:
    """Product R C with a constant C, shapes (Q, 3, 3) and (3, 3) -> (Q, 3, 3)."""
    out = np.zeros((3, 3, len(R)))
    for k, j in zip(*np.nonzero(C), strict=True):  # most C are sparse: rotations about a coordinate axis
        out[:, j] += R[:, :, k].T * C[k, j]
    return np.moveaxis(out, -1, 0)


def _about(R: Array, axis: Array, angle: Array) -> Array:
    """Rotate R about a body-fixed axis (Rodrigues' formula), shapes (Q, 3, 3), (3,) and (Q,) -> (Q, 3, 3)."""
    x, y, z = axis
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    sine, rest = np.sin(angle)[:, None, None], (1.0 - np.cos(angle))[:, None, None]
    return R + sine * turned_frame(R, K) + rest * turned_frame(R, K @ K)


def inverse_torque(model: mujoco.MjModel, q: Array, dq: Array, ddq: Array) -> Array:
    """Inverse dynamics, shape (Q, J): inertia with rotors, gravity and springs, but no friction or damping.

    Contacts, joint limits and Coulomb friction are constraints in MuJoCo and are disabled.

    Args:
        model: compiled model whose joints all have one degree of freedom; some may follow the J others.
        q, dq, ddq: positions of the J joints and their derivatives, shape (Q, J).
    """
    bare = copy.copy(model)
    bare.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    bare.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)
    bare.opt.enableflags &= ~int(mujoco.mjtEnableBit.mjENBL_INVDISCRETE)  # ddq is continuous
    bare.dof_damping[:] = 0.0
    data, coupling = mujoco.MjData(bare), Coupling.of(model)
    q, dq, ddq = coupling.all(q, dq, ddq)
    out = np.empty_like(q)
    for k in range(len(q)):
        data.qpos[:], data.qvel[:], data.qacc[:] = q[k], dq[k], ddq[k]
        mujoco.mj_inverse(bare, data)
        out[k] = data.qfrc_inverse
    return coupling.driven(out)


PARAMETERS = ("m", "hx", "hy", "hz", "Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")
"""Mass [kg], first moments [kg m] and inertia about the body frame's origin [kg m^2], in body axes."""


def inertial_parameters(mass: float, com: Array, inertia: Array) -> Array:
    """The ten inertial parameters of a body from its mass, centre of mass and central inertia, shape (10,)."""
    about = inertia + mass * point_inertia(com)
    return np.array([mass, *(mass * com), *np.diag(about), about[0, 1], about[0, 2], about[1, 2]])


def body_regressor(motion: Motion, body: int) -> Array:
    """Joint torques per unit of each inertial parameter of a body, shape (Q, J, 10); cached."""
    if body not in motion.known:
        motion.known[body] = _body_regressor(motion, body)
    return motion.known[body]


def _body_regressor(motion: Motion, body: int) -> Array:
    tree = motion.tree
    R, a = motion.rotation[body], motion.acceleration[body]
    w, al = motion.omega[body], motion.alpha[body]
    own = R.swapaxes(1, 2)  # to body axes
    wb, alb = turned(own, w), turned(own, al)
    inner = [turned(R, times(E, alb) + cross(wb, times(E, wb))) for E in _unit_inertias()]
    axes = [R[..., k] for k in range(3)]
    by_axis = [cross(al, e) + cross(w, cross(w, e)) for e in axes]
    by_acceleration = [cross(e, a) for e in axes]
    out = np.moveaxis(np.zeros((len(tree.joint_body), 10, len(a))), -1, 0)
    for j in np.flatnonzero(tree.moved[:, body]):
        s = motion.axis[j]
        # s . (r x f) = (s x r) . f
        force = s if tree.slides[j] else cross(s, motion.origin[body] - motion.anchor[j])
        out[:, j, 0] = dot(force, a)
        for k in range(3):
            out[:, j, 1 + k] = dot(force, by_axis[k])
            if not tree.slides[j]:
                out[:, j, 1 + k] += dot(s, by_acceleration[k])
        for k in range(0 if tree.slides[j] else 6):
            out[:, j, 4 + k] = dot(s, inner[k])
    return tree.coupling.driven(out)


def rigid_torque(motion: Motion) -> Array:
    """Joint torques that the rigid bodies require, without rotors, shape (Q, J); cached."""
    if None not in motion.known:
        motion.known[None] = _rigid_torque(motion)
    return motion.known[None]


def _rigid_torque(motion: Motion) -> Array:
    tree, samples = motion.tree, motion.origin.shape[1]
    force, moment = vectors(len(tree.parent), samples), vectors(len(tree.parent), samples)
    out = np.zeros((len(tree.joint_body), samples)).T
    for b in range(len(tree.parent) - 1, 0, -1):
        if tree.mass[b]:  # a fit may pass through negative masses
            R, w, al = motion.rotation[b], motion.omega[b], motion.alpha[b]
            own = R.swapaxes(1, 2)
            lever = turned(R, tree.com[b])
            f = tree.mass[b] * (motion.acceleration[b] + rigid(w, al, lever))
            spin, change = (turned(R, times(tree.inertia[b], turned(own, x))) for x in (w, al))
            force[b] += f
            moment[b] += change + cross(w, spin) + cross(lever, f)
        for j in np.flatnonzero(tree.joint_body == b):
            s = motion.axis[j]
            if tree.slides[j]:
                out[:, j] = dot(s, force[b])
            else:
                out[:, j] = dot(s, moment[b] + cross(motion.origin[b] - motion.anchor[j], force[b]))
        up = tree.parent[b]
        force[up] += force[b]
        moment[up] += moment[b] + cross(motion.origin[b] - motion.origin[up], force[b])
    return tree.coupling.driven(out)


def torque_of(tree: Tree, q: Array, dq: Array, ddq: Array) -> Array:
    """The torques of ``rigid_torque`` from joint positions, velocities and accelerations, shape (Q, J) each."""
    return rigid_torque(Motion.of(tree, q, dq, ddq))


def force_torque(motion: Motion, body: int, point: Array) -> Array:
    """Joint torques per newton of a force on a body along each world axis, shape (Q, J, 3).

    Args:
        motion: motion of the tree.
        body: the body on which the force acts.
        point: point of attack in the body frame [m], shape (3,).
    """
    tree = motion.tree
    at = motion.origin[body] + turned(motion.rotation[body], point)
    out = np.zeros((at.shape[0], len(tree.joint_body), 3))
    for j in np.flatnonzero(tree.moved[:, body]):
        s = motion.axis[j]
        out[:, j] = s if tree.slides[j] else cross(s, at - motion.anchor[j])
    return tree.coupling.driven(out)


@cache
def _unit_inertias() -> list[Array]:
    """Inertia matrices of one unit of each of the last six inertial parameters."""
    pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    return [np.array([[float({i, j} == {a, b}) for j in range(3)] for i in range(3)]) for a, b in pairs]


def carried(tree: Tree) -> Array:
    """Whether a body (column) descends from another (row) or is the same one, as 0 and 1, shape (B, B)."""
    out = np.eye(len(tree.parent))
    for b in range(1, len(tree.parent)):
        out[:, b] += out[:, tree.parent[b]]
    return out


def by_acceleration(motion: Motion) -> Array:
    """Joint torques per unit of acceleration of the base along each world axis, shape (Q, J, 3).

    Gravity in the opposite direction has the same effect.
    """
    tree = motion.tree
    mass, moment = _masses(motion)
    out = np.zeros((motion.origin.shape[1], len(tree.joint_body), 3))
    for j, b in enumerate(tree.joint_body):
        s = motion.axis[j]
        arm = moment[b] - mass[b] * motion.anchor[j]
        out[:, j] = s * mass[b] if tree.slides[j] else cross(s, arm)
    return tree.coupling.driven(out)


def by_displacement(motion: Motion, body: int) -> Array:
    """Joint torques per metre of displacement of a body frame along its parent's axes, shape (Q, J, 3).

    All descendants are displaced, too. This changes their lever arms and, if the parent rotates, their accelerations.
    """
    tree, up = motion.tree, motion.tree.parent[body]
    mass, moment = _masses(motion)
    below = np.flatnonzero(carried(tree)[body])
    force = sum((_force(motion, int(b)) for b in below if tree.mass[b]), np.zeros_like(motion.origin[0]))
    out = np.zeros((motion.origin.shape[1], len(tree.joint_body), 3))
    for k in range(3):
        d = motion.rotation[up][:, :, k]
        a = rigid(motion.omega[up], motion.alpha[up], d)
        for j, own in enumerate(tree.joint_body):
            s, anchor = motion.axis[j], motion.anchor[j]
            if own in below:
                push, turn = mass[own] * a, cross(moment[own] - mass[own] * anchor, a)
            elif tree.moved[j, body]:
                push = mass[body] * a
                turn = cross(d, force) + cross(moment[body] - mass[body] * anchor, a)
            else:
                continue
            out[:, j, k] = np.sum(s * (push if tree.slides[j] else turn), axis=1)
    return tree.coupling.driven(out)


def _masses(motion: Motion) -> tuple[Array, Array]:
    """Mass of each body with its descendants (B,), and its first moment about the world origin (B, Q, 3)."""
    tree = motion.tree
    below = carried(tree)
    centres = motion.origin + np.einsum("bqij,bj->bqi", motion.rotation, tree.com)
    return below @ tree.mass, np.einsum("ab,bqi->aqi", below, tree.mass[:, None, None] * centres)


def _force(motion: Motion, body: int) -> Array:
    """Net force that a body's motion requires, shape (Q, 3)."""
    lever = motion.rotation[body] @ motion.tree.com[body]
    a = motion.acceleration[body] + rigid(motion.omega[body], motion.alpha[body], lever)
    return motion.tree.mass[body] * a


def horizontal(gravity: Array) -> Array:
    """Two unit vectors orthogonal to gravity, shape (2, 3)."""
    return np.linalg.svd(gravity[None] / max(float(np.linalg.norm(gravity)), 1e-12))[2][1:]


def with_load(mass: float, com: Array, inertia: Array, load: Array) -> tuple[float, Array, Array]:
    """Mass, centre of mass and central inertia of a body after adding inertial parameters ``load``, shape (10,)."""
    total = max(mass + float(load[0]), 0.05 * mass)
    centre = (mass * com + load[1:4]) / total
    own = inertia + mass * point_inertia(com) + moments_matrix(load[4:])
    return total, centre, own - total * point_inertia(centre)


def moments_matrix(moments: Array) -> Array:
    """The inertia of its moments xx, yy, zz, xy, xz, yz, shape (6,) -> (3, 3)."""
    xx, yy, zz, xy, xz, yz = moments
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
