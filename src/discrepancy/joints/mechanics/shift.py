"""What small shifts of a tree's frames do to its joint torques, to first order."""

import numpy as np

from discrepancy.joints.mechanics.motion import Motion, cross, rigid
from discrepancy.joints.mechanics.tree import Tree
from estimator.arrays import Array


def carried(tree: Tree) -> Array:
    """Which bodies hang on which, each on itself, as 0 and 1, shape (B, B): [upper, lower]."""
    out = np.eye(len(tree.parent))
    for b in range(1, len(tree.parent)):
        out[:, b] += out[:, tree.parent[b]]
    return out


def by_acceleration(motion: Motion) -> Array:
    """Joint torques per unit of an acceleration of everything along each of the world's axes, shape (Q, J, 3).

    Gravity of -1 m/s^2 does the same.
    """
    tree = motion.tree
    mass, moment = _masses(motion)
    out = np.zeros((motion.origin.shape[1], len(tree.joint_body), 3))
    for j, b in enumerate(tree.joint_body):
        s = motion.axis[j]
        arm = moment[b] - mass[b] * motion.anchor[j]
        out[:, j] = s * mass[b] if tree.slides[j] else cross(s, arm)
    return out


def by_displacement(motion: Motion, body: int) -> Array:
    """Joint torques per metre by which a body's frame is displaced in its parent's, along its axes, shape (Q, J, 3).

    All that hangs on it moves along: its accelerations change as the parent turns, and its levers.
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
    return out


def _masses(motion: Motion) -> tuple[Array, Array]:
    """Mass of what hangs on every body, shape (B,), and its first moment about the world's origin, (B, Q, 3)."""
    tree = motion.tree
    below = carried(tree)
    centres = motion.origin + np.einsum("bqij,bj->bqi", motion.rotation, tree.com)
    return below @ tree.mass, np.einsum("ab,bqi->aqi", below, tree.mass[:, None, None] * centres)


def _force(motion: Motion, body: int) -> Array:
    """Force that a body's motion needs, shape (Q, 3)."""
    lever = motion.rotation[body] @ motion.tree.com[body]
    a = motion.acceleration[body] + rigid(motion.omega[body], motion.alpha[body], lever)
    return motion.tree.mass[body] * a
