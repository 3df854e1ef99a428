"""How every body of a tree moves when its joints do: the outward pass of Newton and Euler's recursion.

Featherstone, "Rigid Body Dynamics Algorithms" (2008), section 5.3, written at the bodies' origins in the world's axes.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from discrepancy.serial.mechanics.tree import Tree
from estimator.arrays import Array


@dataclass(frozen=True, eq=False)
class Motion:
    """Of Q samples; vectors in the world's axes, origins those of the bodies' frames.

    Attributes:
        tree: what moves.
        rotation: of every body in the world, shape (B, Q, 3, 3).
        origin: shape (B, Q, 3) [m].
        omega, alpha: angular velocity and acceleration, shape (B, Q, 3).
        acceleration: of the origins, less gravity's, shape (B, Q, 3) [m/s^2].
        axis, anchor: of every joint, shape (J, Q, 3).
        regressors: of bodies, as far as they were asked for (``regressor.body_regressor``).
    """

    tree: Tree
    rotation: Array
    origin: Array
    omega: Array
    alpha: Array
    acceleration: Array
    axis: Array
    anchor: Array
    regressors: dict[int, Array] = field(default_factory=dict, repr=False)

    @classmethod
    def of(cls, tree: Tree, q: Array, dq: Array, ddq: Array) -> Motion:
        """Motion of all bodies from joint positions, velocities and accelerations, shape (Q, J) each."""
        Q, B, J = len(q), len(tree.parent), len(tree.joint_body)
        R, p, w, al, a = (np.zeros((B, Q, *s)) for s in ((3, 3), (3,), (3,), (3,), (3,)))
        axis, anchor = np.zeros((J, Q, 3)), np.zeros((J, Q, 3))
        R[0], a[0] = np.eye(3), -tree.gravity
        for b in range(1, B):
            up = tree.parent[b]
            lever = R[up] @ tree.position[b]
            Rb, pb = R[up] @ tree.rotation[b], p[up] + lever
            wb, alb, ab = w[up], al[up], a[up] + rigid(w[up], al[up], lever)
            for j in np.flatnonzero(tree.joint_body == b):
                s, to = Rb @ tree.axis[j], Rb @ tree.anchor[j]
                axis[j], anchor[j] = s, pb + to
                rate, turn = s * dq[:, j, None], (q[:, j] - tree.zero[j])[:, None]
                if tree.slides[j]:
                    shift = s * turn
                    ab = ab + rigid(wb, alb, shift) + 2.0 * cross(wb, rate) + s * ddq[:, j, None]
                    pb = pb + shift
                    continue
                at = ab + rigid(wb, alb, to)
                alb = alb + s * ddq[:, j, None] + cross(wb, rate)
                wb = wb + rate
                Rb = Rb @ _about(tree.axis[j], turn[:, 0])
                back = -(Rb @ tree.anchor[j])
                pb, ab = anchor[j] + back, at + rigid(wb, alb, back)
            R[b], p[b], w[b], al[b], a[b] = Rb, pb, wb, alb, ab
        return cls(tree, R, p, w, al, a, axis, anchor)


def rigid(omega: Array, alpha: Array, lever: Array) -> Array:
    """Acceleration of a point over that of another of the same body, alpha x r + omega x (omega x r), shape (Q, 3)."""
    return cross(alpha, lever) + cross(omega, cross(omega, lever))


def cross(a: Array, b: Array) -> Array:
    """Cross product along the last axis; several times as fast as numpy's."""
    a0, a1, a2 = a[..., 0], a[..., 1], a[..., 2]
    b0, b1, b2 = b[..., 0], b[..., 1], b[..., 2]
    return np.stack([a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0], axis=-1)


def _about(axis: Array, angle: Array) -> Array:
    """Rodrigues' rotations about one axis, shape (Q, 3, 3)."""
    x, y, z = axis
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle)[:, None, None] * K + (1.0 - np.cos(angle))[:, None, None] * (K @ K)
