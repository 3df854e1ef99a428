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
    size = float(np.abs(way).max())
    if size == 0.0:
        return np.zeros_like(signals.q)
    step = (STEP_M if signals.tree.slides[at] else STEP_RAD) / size
    first = differentiate(way, signals.rate_hz)
    moved = []
    for x, change in (
        (signals.q, way),
        (signals.dq, first),
        (signals.ddq, differentiate(first, signals.rate_hz)),
    ):
        other = x.copy()
        other[:, at] += step * change
        moved.append(other)
    return (torque_of(signals.tree, *moved) - rigid_torque(signals.motion)) / step
