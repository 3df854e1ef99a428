"""Direction of gravity at the base: small tilts about the model's direction, or about one that the logs ask for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from discrepancy.joints.mechanics import by_acceleration, horizontal
from discrepancy.joints.signals import Signals
from estimator.arrays import Array

LEAST_RAD = 0.5
"""Smallest angle between modelled and fitted gravity that counts as another mount. Chosen: tilts below are linear."""
LEAST_GAIN = 4.0
"""Smallest factor by which another direction reduces a joint's squared residual. Chosen: far beyond noise."""
SIZE = (0.7, 1.4)
"""Range of the fitted over the modelled size of gravity. Chosen: masses are known to a third."""
TURN = "gravity turn"
"""Label of the column from the model's gravity (0) to that of the other mount (1)."""


def mount_of(smooth: Sequence[Signals], joints: Sequence[int]) -> Array | None:
    """Gravity of another mount than the model's, such as a ceiling or a wall, in the base's frame [m/s^2], shape (3,).

    Fits the vector of gravity, common to all joints, with an offset, dry and viscous friction and an inertia of each
    joint by least squares.

    Args:
        smooth: signals of the logs.
        joints: indices of the joints with torques.

    Returns:
        The fitted direction with the model's size; None if the model's direction is as good, or no size fits.
    """
    g = smooth[0].tree.gravity
    size = float(np.linalg.norm(g))
    if not size:
        return None
    by = {id(s): by_acceleration(s.motion) for s in smooth}
    each: list[
        Array
    ] = []  # by joint: torque per gravity and residual, without what the joint's own columns explain
    for j in joints:
        rows, own = [], []
        for s in smooth:
            here = np.flatnonzero(s.usable[:, j])
            v = s.dq[here, j]
            rows.append(np.column_stack([-by[id(s)][here, j], (s.torque - s.inverse)[here, j]]))
            own.append(np.column_stack([np.ones(len(v)), np.sign(v), v, s.ddq[here, j]]))
        x, q = np.concatenate(rows), np.linalg.qr(np.concatenate(own))[0]
        x = x - q @ (q.T @ x)
        each.append(x.T @ x)
    noise, there = np.array([x[3, 3] + 1e-12 for x in each]), g
    for _ in range(3):  # weigh each joint by what is left of it, until the weights stay
        total = np.sum([x / n for x, n in zip(each, noise, strict=True)], axis=0)
        there = g + np.linalg.lstsq(total[:3, :3], total[:3, 3], rcond=1e-6)[0]
        with_it = np.append(g - there, 1.0)
        noise = np.array([with_it @ x @ with_it + 1e-12 for x in each])
    gain = max(x[3, 3] / n for x, n in zip(each, noise, strict=True))
    ratio = float(np.linalg.norm(there)) / size
    if angle_between(g, there) < LEAST_RAD or gain < LEAST_GAIN or not SIZE[0] < ratio < SIZE[1]:
        return None
    return there / ratio


def ways(g: Array, mount: Array | None) -> dict[str, Array]:
    """Changes of gravity against which a unit of each column acts, by its label; ``mount`` None: about the model's."""
    middle = g if mount is None else mount
    found = {f"tilt {i}": np.cross(w, middle) for i, w in enumerate(horizontal(middle))}
    return found if mount is None else found | {TURN: g - mount}


def gravity_at(g: Array, mount: Array | None, values: Mapping[str, float]) -> Array:
    """Gravity [m/s^2] at values of the columns, shape (3,); columns without a value are at 0."""
    return g - np.sum([values.get(label, 0.0) * way for label, way in ways(g, mount).items()], axis=0)


def angle_between(one: Array, other: Array) -> float:
    """Angle between two directions [rad]."""
    return float(np.arctan2(np.linalg.norm(np.cross(one, other)), one @ other))
