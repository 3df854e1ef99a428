"""Signals of a machine whose numbers are not the model's: slopes do not tell how tolerances multiply each other."""

from __future__ import annotations

from dataclasses import replace

from discrepancy.serial.mechanics.regressor import rigid_torque
from discrepancy.serial.rows.signals import Signals
from estimator.arrays import Array


def with_tree(signals: Signals, **numbers: Array) -> Signals:
    """The signals with some numbers of their tree replaced; what it asks for is left as it was."""
    return replace(signals, tree=replace(signals.tree, **numbers))


def asking(signals: Signals, moved: Signals) -> Signals:
    """Moved signals with the torques that their tree asks for.

    Args:
        signals: as the model has them. What else its torques hold, such as springs, stays as it is.
        moved: the same with another tree, or other zeros.
    """
    change = rigid_torque(moved.motion) - rigid_torque(signals.motion)
    return replace(moved, inverse=signals.inverse + change)
