"""Torques of a joint that is not where it is said to be."""

from __future__ import annotations

import numpy as np

from discrepancy.joints.mechanics.regressor import rigid_torque, torque_of
from discrepancy.joints.signals import Signals
from estimator.arrays import Array
from estimator.filtering import differentiate

STEP_RAD, STEP_M = 1e-4, 1e-5
"""Of differences by joint positions. Derived: squares of the step and rounding are both below 1e-6."""


def along(signals: Signals, at: int, way: Array) -> Array:
    """Change of the nominal torques per unit of a change of one joint's position over time, shape (W, J).

    Args:
        signals: of one log.
        at: the joint.
        way: in which direction and how far, shape (W,).
    """
    first = differentiate(way, signals.rate_hz)
    ways = (way, first, differentiate(first, signals.rate_hz))
    return np.asarray(sum(x * own[:, None] for x, own in zip(_partials(signals, at), ways, strict=True)))


def _partials(signals: Signals, at: int) -> list[Array]:
    """Change of the torques with a joint's position, velocity and acceleration, shape (W, J) each; remembered."""
    known = signals.__dict__.setdefault("_partials", {})
    if at not in known:
        known[at], step = [], STEP_M if signals.tree.slides[at] else STEP_RAD
        for k in range(3):
            moved = [signals.q, signals.dq, signals.ddq]
            moved[k] = moved[k].copy()
            moved[k][:, at] += step
            known[at].append((torque_of(signals.tree, *moved) - rigid_torque(signals.motion)) / step)
    return known[at]
