"""A formula: one function of a signal, possibly times another signal."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from discrepancy.laws.functions import FUNCTIONS, Function
from discrepancy.laws.variable import Variable
from estimator.arrays import Array


@dataclass(frozen=True)
class Term:
    """One function of a signal.

    Attributes:
        function: name in the dictionary.
        of: the signal.
        numbers: inside the function.
        times: another signal that multiplies it, or None.
    """

    function: str
    of: Variable
    numbers: Mapping[str, float] = field(default_factory=dict)
    times: Variable | None = None

    @property
    def law(self) -> Function:
        """The function."""
        return FUNCTIONS[self.function]

    def values(self, signal: Callable[[Variable], Array], rate_hz: float) -> Array:
        """Values in one trial, shape (Q, k): one amplitude each; of a vector those of one component after the other.

        Args:
            signal: values of a variable in that trial, shape (Q,).
            rate_hz: their rate.
        """
        each = [self.law.of(signal(part), rate_hz, self.numbers) for part in self.of.each]
        out = np.concatenate(each, axis=1)
        return out if self.times is None else out * signal(self.times)[:, None]

    @property
    def variables(self) -> tuple[str, ...]:
        """Names of the signals."""
        return (self.of.name,) if self.times is None else (self.of.name, self.times.name)
