"""What a rig offers to the search for laws."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from discrepancy.laws.place import Place
from discrepancy.laws.variable import Variable
from estimator.arrays import Array


class Bench(Protocol):
    """Places, signals, and what an error at a place does to the rows."""

    @property
    def places(self) -> Sequence[Place]:
        """All of them."""
        ...

    @property
    def variables(self) -> Sequence[Variable]:
        """All signals, time among them."""
        ...

    def rate_hz(self, trial: int) -> float:
        """Of a trial's signals [Hz]."""
        ...

    def length(self, trial: int) -> int:
        """Samples Q of a trial."""
        ...

    def row_times(self, trial: int) -> Array:
        """Middle of every row since the trial's first sample [s], shape (n,)."""
        ...

    def signal(self, trial: int, variable: Variable) -> Array:
        """Values of a signal, shape (Q,)."""
        ...

    def at_rows(self, trial: int, errors: Array, *, rates: bool) -> Array:
        """Errors as functions of time, shape (Q, k), at the rows: value (rate, acceleration), shape (n, 1 or 3, k)."""
        ...

    def directions(self, trial: int, place: Place) -> Array:
        """What value, rate and acceleration of an error do, shape (n, components, 3 or 1, C), not whitened.

        The last but one is 1 where rates do nothing.
        """
        ...

    def white(self, trial: int, columns: Array) -> Array:
        """Whitened columns, shape (n, C, k) -> the same."""
        ...

    def twin(self, place: Place) -> Place | None:
        """Another place whose rows are the same, minus these, or None."""
        ...
