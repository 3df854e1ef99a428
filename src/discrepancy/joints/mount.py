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
"""Smallest factor by which another direction reduces the squared residual. Chosen: far beyond noise."""
SIZE = (0.7, 1.4)
"""Range of the fitted over the modelled size of gravity. Chosen: masses are known to a third."""
MOST_SAMPLES = 4000
"""Most samples of a log in the fit. Chosen: a few hundred parameters' worth."""
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
    rows, own = [], []
    for s in smooth:
        here = slice(None, None, max(1, len(s.time) // MOST_SAMPLES))
        by, good = by_acceleration(s.motion)[here], s.usable[here]
        weight = 1.0 / (np.sqrt(np.mean(s.torque**2, axis=0)) + 1e-12)
        left, v, a = (s.torque - s.inverse)[here], s.dq[here], s.ddq[here]
        for j in joints:
            alone = np.column_stack([np.ones(len(v)), np.sign(v[:, j]), v[:, j], a[:, j]])
            k = good[:, j]
            rows.append(np.column_stack([-by[k, j], left[k, j]]) * weight[j])
            own.append((j, alone[k] * weight[j]))
    squares, products, before = np.zeros((3, 3)), np.zeros(3), 0.0
    for j in joints:  # project the joint's own columns out
        x = np.concatenate([r for r, (k, _) in zip(rows, own, strict=True) if k == j])
        q = np.linalg.qr(np.concatenate([c for k, c in own if k == j]))[0]
        x = x - q @ (q.T @ x)
        squares, products = squares + x[:, :3].T @ x[:, :3], products + x[:, :3].T @ x[:, 3]
        before += float(x[:, 3] @ x[:, 3])
    change = np.linalg.lstsq(squares, products, rcond=1e-6)[0]
    after, there = before - float(products @ change), g + change
    ratio = float(np.linalg.norm(there)) / size
    if angle_between(g, there) < LEAST_RAD or before < LEAST_GAIN * after or not SIZE[0] < ratio < SIZE[1]:
        return None
    return there / ratio


def ways(g: Array, mount: Array | None) -> dict[str, Array]:
    """Changes of gravity against which a unit of each column acts, by its label, shape (3,) each.

    Args:
        g: gravity of the model [m/s^2], shape (3,).
        mount: gravity of another mount, shape (3,); None: small tilts about the model's.
    """
    middle = g if mount is None else mount
    found = {f"tilt {i}": np.cross(w, middle) for i, w in enumerate(horizontal(middle))}
    return found if mount is None else found | {TURN: g - mount}


def gravity_at(g: Array, mount: Array | None, values: Mapping[str, float]) -> Array:
    """Gravity [m/s^2] at values of the columns, shape (3,); columns without a value are at 0."""
    return g - sum(values.get(label, 0.0) * way for label, way in ways(g, mount).items())


def angle_between(one: Array, other: Array) -> float:
    """Angle between two directions [rad]."""
    return float(np.arctan2(np.linalg.norm(np.cross(one, other)), one @ other))
