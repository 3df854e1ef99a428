"""Joint torques as a linear function of inertial parameters, and the inward pass of Newton and Euler's recursion.

Khalil and Dombre, "Modeling, Identification and Control of Robots" (2002), section 12.3.
"""

from functools import cache

import numpy as np

from discrepancy.joints.mechanics.motion import Motion, cross, dot, rigid, times, turned, vectors
from discrepancy.joints.mechanics.tree import Tree
from estimator.arrays import Array

PARAMETERS = ("m", "hx", "hy", "hz", "Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")
"""Mass [kg], first moments [kg m] and inertia about the origin of the body's frame [kg m^2], along that frame."""


def inertial_parameters(mass: float, com: Array, inertia: Array) -> Array:
    """The ten numbers of a body of a mass, a centre and an inertia about that centre, shape (10,)."""
    about = inertia + mass * (com @ com * np.eye(3) - np.outer(com, com))
    return np.array([mass, *(mass * com), *np.diag(about), about[0, 1], about[0, 2], about[1, 2]])


def body_regressor(motion: Motion, body: int) -> Array:
    """Joint torques per unit of each of a body's ten numbers, shape (Q, J, 10); kept with the motion."""
    if body not in motion.known:
        motion.known[body] = _body_regressor(motion, body)
    return motion.known[body]


def _body_regressor(motion: Motion, body: int) -> Array:
    tree = motion.tree
    R, a = motion.rotation[body], motion.acceleration[body]
    w, al = motion.omega[body], motion.alpha[body]
    own = R.swapaxes(1, 2)  # to the body's axes
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
    return out


def rigid_torque(motion: Motion) -> Array:
    """Torques of all joints that the tree's rigid bodies need, shape (Q, J); kept with the motion."""
    if None not in motion.known:
        motion.known[None] = _rigid_torque(motion)
    return motion.known[None]


def _rigid_torque(motion: Motion) -> Array:
    tree, samples = motion.tree, motion.origin.shape[1]
    force, moment = vectors(len(tree.parent), samples), vectors(len(tree.parent), samples)
    out = np.zeros((len(tree.joint_body), samples)).T
    for b in range(len(tree.parent) - 1, 0, -1):
        if tree.mass[b]:  # a fit may pass through masses below nought
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
    return out


def torque_of(tree: Tree, q: Array, dq: Array, ddq: Array) -> Array:
    """The same from joint positions, velocities and accelerations, shape (Q, J) each."""
    return rigid_torque(Motion.of(tree, q, dq, ddq))


def force_torque(motion: Motion, body: int, point: Array) -> Array:
    """Joint torques per newton of a force on a body along each of the world's axes, shape (Q, J, 3).

    Args:
        motion: of the tree.
        body: which is pushed.
        point: where, in the body's frame [m], shape (3,).
    """
    tree = motion.tree
    at = motion.origin[body] + turned(motion.rotation[body], point)
    out = np.zeros((at.shape[0], len(tree.joint_body), 3))
    for j in np.flatnonzero(tree.moved[:, body]):
        s = motion.axis[j]
        out[:, j] = s if tree.slides[j] else cross(s, at - motion.anchor[j])
    return out


@cache
def _unit_inertias() -> list[Array]:
    """The last six of the parameters, one unit each, as matrices."""
    pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    return [np.array([[float({i, j} == {a, b}) for j in range(3)] for i in range(3)]) for a, b in pairs]
