"""How every body of a tree moves when its joints do: the outward pass of Newton and Euler's recursion.

Featherstone, "Rigid Body Dynamics Algorithms" (2008), section 5.3, written at the bodies' origins in the world's axes.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from discrepancy.joints.mechanics.tree import Tree
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
        known: what ``regressor`` made of it: torques per unit of a body's numbers, and those of all bodies under None.
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
        """Motion of all bodies from joint positions, velocities and accelerations, shape (Q, J) each."""
        Q, B, J = len(q), len(tree.parent), len(tree.joint_body)
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
                off = tree.anchor[j].any()  # most bodies' frames are on the axis
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
    """Acceleration of a point over that of another of the same body, alpha x r + omega x (omega x r), shape (Q, 3)."""
    return cross(alpha, lever) + cross(omega, cross(omega, lever))


def vectors(*shape: int) -> Array:
    """Vectors of nought, shape (..., Q, 3); a component's samples follow each other: faster for all made of them."""
    return np.swapaxes(np.zeros((*shape[:-1], 3, shape[-1])), -1, -2)


def cross(a: Array, b: Array) -> Array:
    """Cross product along the last axis; many times as fast as numpy's."""
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
    """R v, shapes (Q, 3, 3), (Q, 3) or (3,) -> (Q, 3)."""
    out = np.empty((3, len(R)))
    for i in range(3):
        np.multiply(R[:, i, 0], v[..., 0], out=out[i])
        out[i] += R[:, i, 1] * v[..., 1]
        out[i] += R[:, i, 2] * v[..., 2]
    return out.T


def times(C: Array, v: Array) -> Array:
    """C v with one constant C, shapes (3, 3), (Q, 3) -> (Q, 3)."""
    return (C @ v.T).T


def turned_frame(R: Array, C: Array) -> Array:
    """R C with one constant C, shapes (Q, 3, 3), (3, 3) -> (Q, 3, 3)."""
    out = np.zeros((3, 3, len(R)))
    for k, j in zip(*np.nonzero(C), strict=True):  # most are turns about an axis
        out[:, j] += R[:, :, k].T * C[k, j]
    return np.moveaxis(out, -1, 0)


def _about(R: Array, axis: Array, angle: Array) -> Array:
    """R turned on about an axis of its own by Rodrigues' formula, shapes (Q, 3, 3), (3,), (Q,) -> (Q, 3, 3)."""
    x, y, z = axis
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    sine, rest = np.sin(angle)[:, None, None], (1.0 - np.cos(angle))[:, None, None]
    return R + sine * turned_frame(R, K) + rest * turned_frame(R, K @ K)
