"""Numbers as sentences show them."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from estimator.statistics import measured


def number(value: float, se: float | None, unit: str, scale: float = 1.0) -> str:
    """``0.0500 +- 0.0012 N m``: as many digits as the standard error has meaning; without one, three digits.

    Args:
        value: in the parameter's own unit.
        se: its standard error, or None or NaN where it has none.
        unit: to be shown.
        scale: shown units per own unit.
    """
    unit = f" {unit}" if unit else ""
    if se is None or not np.isfinite(se) or se <= 0:
        return f"{value * scale:.3g}{unit}"
    return " +- ".join(measured(value * scale, se * scale)) + unit


@dataclass(frozen=True)
class Numbers:
    """Parameters of one cause, to be put into a sentence.

    Attributes:
        values: by name, units in the names.
        se: their standard errors; NaN, or no entry, where there is none.
    """

    values: Mapping[str, float]
    se: Mapping[str, float]

    def __call__(self, name: str, unit: str, scale: float = 1.0, *, signed: bool = False) -> str:
        """One parameter, its sign left to the words around it unless ``signed``; otherwise as ``number``."""
        value = self.values[name] if signed else abs(self.values[name])
        return number(value, self.se.get(name), unit, scale)

    def vector(self, stem: str, unit: str) -> str:
        """``({stem}_x_{unit}, y, z) unit``."""
        names = [f"{stem}_{axis}_{unit}" for axis in "xyz"]
        return f"({', '.join(number(self.values[name], self.se.get(name), '') for name in names)}) {unit}"

    def either(self, name: str, more: str, less: str) -> str:
        """The word for the sign of a parameter."""
        return more if self.values[name] >= 0 else less
