"""What a rig says about its causes in words; the JSON and the report take it from here."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

import numpy as np

from discrepancy.rig import Candidate
from estimator.numbers import measured


class Words(Protocol):
    """Sentences about one rig's causes and channels."""

    def describe(self, candidate: Candidate, values: Mapping[str, float], se: Mapping[str, float]) -> str:
        """What a cause does at its place, one sentence with its numbers; standard errors may be NaN."""
        ...

    def separate(self, cause: str) -> str:
        """Which experiment would tell a cause from its look-alikes, one sentence, or nothing."""
        ...

    def unit(self, name: str) -> str:
        """Unit of a closed-loop channel, or of a quantity that a misfit may depend on."""
        ...


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
