"""What every cause of the axis' catalogue offers the diagnosis."""

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from discrepancy.causes import base
from discrepancy.causes.base import Shape
from discrepancy.emps.recording.signals import Signals, smooth
from estimator.arrays import Array


@dataclass(frozen=True, eq=False)
class Hints:
    """Where to begin with shapes that are found, not assumed.

    Attributes:
        wavelength_m: of the strongest ripple along the way.
        voltage_train, force_train: ``start_s``, ``period_s``, ``width_s`` of what looks most like rectangles.
        voltage_spread, force_spread: what is left around these [V, N], standard deviation of rows.
        cycle_s: after which the reference repeats itself; None if it does not.
    """

    wavelength_m: float
    voltage_train: Shape
    force_train: Shape
    voltage_spread: float
    force_spread: float
    cycle_s: float | None = None


class Cause(base.Cause):
    """One physical cause: what it adds to the nominal residual per unit of each parameter."""

    where = "axis"

    @abstractmethod
    def columns(self, signals: Signals, shape: Shape) -> Array:
        """What one unit of each parameter adds to force [N] and voltage [V], shape (Q, 2, k)."""

    def exact(self, signals: Signals, values: Array, shape: Shape) -> Array:
        """What the given values add, shape (Q, 2), where that is not linear in them."""
        return self.columns(signals, shape) @ values

    def shapes(self, hints: Hints) -> Sequence[Shape]:
        """Alternatives of what changes the columns themselves; the first is the catalogue's."""
        return [{}]

    def finer(self, shape: Shape) -> Sequence[Shape]:
        """Shapes near a chosen one, for a second look."""
        return []

    def visible(self, signals: Signals, hints: Hints, values: Array) -> bool:
        """Whether a cause of that size stands out of rounding, or of what it was searched in."""
        return True

    def imitators(self, signals: Signals, hints: Hints, shape: Shape) -> Sequence[Shape]:
        """Shapes in which the motion itself may leave the same trace, so that they must tell less than this one."""
        return []

    def rests(self, signals: Signals, shape: Shape) -> list[Array]:
        """Forces (Q,) that the cause leaves open, such as dry friction at rest, one unit each."""
        return []


def filtered(signals: Signals, column: Array) -> Array:
    """A column that is no linear function of smoothed signals, through their filter, shape (Q,)."""
    return smooth(column, signals.log.rate_hz)


def force(*columns: Array) -> Array:
    """Columns that act on the force alone, shape (Q, 2, k)."""
    return np.stack([np.column_stack([c, np.zeros_like(c)]) for c in columns], axis=2)


def voltage(*columns: Array) -> Array:
    """Columns that act on the voltage alone, shape (Q, 2, k)."""
    return np.stack([np.column_stack([np.zeros_like(c), c]) for c in columns], axis=2)
