"""Joint torques as a linear function of inertial parameters, and the inward pass of Newton and Euler's recursion.

Khalil and Dombre, "Modeling, Identification and Control of Robots" (2002), section 12.3.
"""

import numpy as np

from discrepancy.serial.mechanics.motion import Motion, cross
from discrepancy.serial.mechanics.tree import Tree
from estimator.arrays import Array

PARAMETERS = ("m", "hx", "hy", "hz", "Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")
"""Mass [kg], first moments [kg m] and inertia about the origin of the body's frame [kg m^2], along that frame."""


def inertial_parameters(mass: float, com: Array, inertia: Array) -> Array:
    """The ten numbers of a body of a mass, a centre and an inertia about that centre, shape (10,)."""
    about = inertia + mass * (com @ com * np.eye(3) - np.outer(com, com))
    return np.array([mass, *(mass * com), *np.diag(about), about[0, 1], about[0, 2], about[1, 2]])


def body_regressor(motion: Motion, body: int) -> Array:
    """Joint torques per unit of each of a body's ten numbers, shape (Q, J, 10); kept with the motion."""
    if body not in motion.regressors:
        motion.regressors[body] = _body_regressor(motion, body)
    return motion.regressors[body]


def _body_regressor(motion: Motion, body: int) -> Array:
    tree = motion.tree
    R, a = motion.rotation[body], motion.acceleration[body]
    w, al = motion.omega[body], motion.alpha[body]
    own = R.swapaxes(1, 2)  # to the body's axes
    wb, alb = (np.einsum("qij,qj->qi", own, x) for x in (w, al))
    force, moment = np.zeros((len(a), 3, 10)), np.zeros((len(a), 3, 10))
    force[..., 0] = a
    for k in range(3):
        e = R[..., k]
        force[..., 1 + k] = cross(al, e) + cross(w, cross(w, e))
        moment[..., 1 + k] = cross(e, a)
    moment[..., 4:] = R @ (_of_inertia(alb) + _crossed(wb, _of_inertia(wb)))
    out = np.zeros((len(a), len(tree.joint_body), 10))
    for j in np.flatnonzero(tree.moved[:, body]):
        s = motion.axis[j]
        if tree.slides[j]:
            out[:, j] = np.einsum("qi,qik->qk", s, force)
        else:
            arm = cross(s, motion.origin[body] - motion.anchor[j])  # s . (r x f) = (s x r) . f
            out[:, j] = np.einsum("qi,qik->qk", s, moment) + np.einsum("qi,qik->qk", arm, force)
    return out


def rigid_torque(motion: Motion) -> Array:
    """Torques of all joints that the tree's rigid bodies need, shape (Q, J)."""
    tree = motion.tree
    force, moment = np.zeros_like(motion.origin), np.zeros_like(motion.origin)
    out = np.zeros((motion.origin.shape[1], len(tree.joint_body)))
    for b in range(len(tree.parent) - 1, 0, -1):
        if tree.mass[b] > 0:
            R, w = motion.rotation[b], motion.omega[b]
            lever = R @ tree.com[b]
            f = tree.mass[b] * (
                motion.acceleration[b] + cross(motion.alpha[b], lever) + cross(w, cross(w, lever))
            )
            inertia = R @ tree.inertia[b] @ R.swapaxes(1, 2)
            spin = np.einsum("qij,qj->qi", inertia, w)
            n = np.einsum("qij,qj->qi", inertia, motion.alpha[b]) + cross(w, spin)
            force[b] += f
            moment[b] += n + cross(lever, f)
        for j in np.flatnonzero(tree.joint_body == b):
            s = motion.axis[j]
            arm = cross(motion.origin[b] - motion.anchor[j], force[b])
            out[:, j] = np.sum(s * (force[b] if tree.slides[j] else moment[b] + arm), axis=1)
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
    at = motion.origin[body] + motion.rotation[body] @ point
    out = np.zeros((at.shape[0], len(tree.joint_body), 3))
    for j in np.flatnonzero(tree.moved[:, body]):
        s = motion.axis[j]
        out[:, j] = s if tree.slides[j] else cross(s, at - motion.anchor[j])
    return out


def _of_inertia(x: Array) -> Array:
    """I x as a matrix times (Ixx, Iyy, Izz, Ixy, Ixz, Iyz), shape (Q, 3) -> (Q, 3, 6)."""
    zero = np.zeros(len(x))
    x0, x1, x2 = x.T
    rows = [[x0, zero, zero, x1, x2, zero], [zero, x1, zero, x0, zero, x2], [zero, zero, x2, zero, x0, x1]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=1)


def _crossed(w: Array, columns: Array) -> Array:
    """w x every column, shape (Q, 3), (Q, 3, k) -> (Q, 3, k)."""
    return cross(w[:, None, :], columns.swapaxes(1, 2)).swapaxes(1, 2)
