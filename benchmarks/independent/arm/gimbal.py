"""The passive gimbal: its three angles, and the small moment that its bodies' inertia puts on the payload."""

from __future__ import annotations

import numpy as np

from estimator.arm.design import OmnidDesign
from independent.numerics import Array, derivative
from independent.rotations import about, back_turned, turned


def gimbal_angles(R: Array) -> Array:
    """(theta_z, theta_y, theta_x) [rad] with R = Rz Ry Rx, (Q, 3, 3) to (Q, 3)."""
    z = np.arctan2(R[:, 1, 0], R[:, 0, 0])
    y = np.arctan2(-R[:, 2, 0], np.hypot(R[:, 0, 0], R[:, 1, 0]))
    x = np.arctan2(R[:, 2, 1], R[:, 2, 2])
    return np.stack([z, y, x], axis=-1)


def gimbal_moment(theta: Array, resisting: Array, design: OmnidDesign) -> Array:
    """Moment of the gimbal on the payload.

    Args:
        theta: angles (z, y, x) on the fine grid [rad], shape (Q, 3).
        resisting: torque that has to be overcome about each axis, positive while its angle grows [N m], (Q, 3).
        design: the gimbal's inertia.

    Returns:
        Moment on the payload in the arm's frame [N m], shape (Q, 3).
    """
    yoke = about(2, theta[:, 0])
    ring = yoke @ about(1, theta[:, 1])
    flange = ring @ about(0, theta[:, 2])
    axes = np.stack([np.broadcast_to([0.0, 0.0, 1.0], theta.shape), yoke[:, :, 1], ring[:, :, 0]], axis=1)
    turns = np.cumsum(axes * derivative(theta)[..., None], axis=1)
    needed = []
    for body, R in enumerate((yoke, ring, flange)):
        moments = (design.yoke_inertia_kgm2, design.ring_inertia_kgm2, design.flange_inertia_kgm2)[body]
        needed.append(derivative(turned(R, back_turned(R, turns[:, body]) * np.asarray(moments))))
    # About axis j only what lies beyond it turns.
    beyond = np.cumsum(np.stack(needed[::-1], axis=1), axis=1)[:, ::-1]
    about_axes = (beyond * axes).sum(-1) + resisting
    return -np.linalg.solve(axes, about_axes[..., None])[..., 0]
