"""Format numbers and units for sentences."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from estimator.statistics import measured


def number(value: float, se: float | None, unit: str, scale: float = 1.0) -> str:
    """Format a value as in ``0.0500 +- 0.0012 N m``, with digits by the standard error, or else with three digits.

    Args:
        value: in the parameter's own unit.
        se: standard error; None or NaN if there is none.
        unit: displayed unit.
        scale: displayed units per own unit.
    """
    unit = f" {unit}" if unit else ""
    if se is None or not np.isfinite(se) or se <= 0:
        return f"{value * scale:.3g}{unit}"
    return " +- ".join(measured(value * scale, se * scale)) + unit


@dataclass(frozen=True)
class Numbers:
    """Parameters of one cause, for use in a sentence.

    Attributes:
        values: by name, with units in the names.
        se: standard errors; NaN or missing if there is none.
    """

    values: Mapping[str, float]
    se: Mapping[str, float]

    def __call__(self, name: str, unit: str, scale: float = 1.0, *, signed: bool = False) -> str:
        """Format one parameter with ``number``; without its sign unless ``signed``."""
        value = self.values[name] if signed else abs(self.values[name])
        return number(value, self.se.get(name), unit, scale)

    def vector(self, stem: str, unit: str) -> str:
        """Format a vector as ``({stem}_x_{unit}, y, z) unit``."""
        names = [f"{stem}_{axis}_{unit}" for axis in "xyz"]
        return f"({', '.join(number(self.values[name], self.se.get(name), '') for name in names)}) {unit}"

    def either(self, name: str, more: str, less: str) -> str:
        """Select a word by the sign of a parameter."""
        return more if self.values[name] >= 0 else less


TOKENS = {
    "Nm": "N m", "Nms": "N m s", "Ns": "N s", "Ns2": "N s^2", "s2": "s^2",
    "Nms2": "N m s^2", "rad2": "rad^2", "mps": "m/s", "rad": "rad", "rad3": "rad^3", "m": "m", "N": "N", "s": "s",
    "kg": "kg", "kgm": "kg m", "V": "V", "Vs": "V s", "Hz": "Hz", "deg": "deg", "m2": "m^2", "kgm2": "kg m^2",
}  # fmt: skip
SMALL = {
    "m": ("mm", 1e3), "rad": ("mrad", 1e3), "N m": ("mN m", 1e3), "m/s": ("mm/s", 1e3), "V": ("mV", 1e3),
    "s": ("ms", 1e3), "m/N": ("mm/N", 1e3), "rad/N": ("mrad/N", 1e3),
    "rad/N m": ("mrad/N m", 1e3),
}  # fmt: skip
SMALLER = {
    "m": ("um", 1e6), "rad": ("urad", 1e6), "N m": ("uN m", 1e6), "N": ("mN", 1e3), "s": ("us", 1e6),
    "m/s": ("um/s", 1e6), "m/N": ("um/N", 1e6), "rad/N": ("urad/N", 1e6), "rad/N m": ("urad/N m", 1e6),
}  # fmt: skip
Shown = tuple[str, float]
"""A unit, and the factor to it."""


def parameter(name: str) -> tuple[str, str]:
    """Name in words and unit: ``viscous_Nms_per_rad`` is ``viscous`` in ``N m s/rad``."""
    match = re.fullmatch(r"(.+?)_(?:([A-Za-z0-9]+)_)?per_([A-Za-z0-9]+)", name)
    if match and match[3] in TOKENS and (match[2] is None or match[2] in TOKENS):
        top = TOKENS[match[2]] if match[2] else "1"
        return match[1].replace("_", " "), f"{top}/{TOKENS[match[3]]}"
    head, _, last = name.rpartition("_")
    if head and last in TOKENS:
        return head.replace("_", " "), TOKENS[last]
    return name.replace("_", " "), ""


def fitting(unit: str, largest: float) -> Shown:
    """Readable unit for numbers up to a size, and the factor to it."""
    if largest < 1e-4 and unit in SMALLER:
        return SMALLER[unit]
    return SMALL[unit] if largest < 0.1 and unit in SMALL else (unit, 1.0)


def one_each(sizes: Iterable[tuple[str, float]]) -> dict[str, Shown]:
    """Readable unit for each unit of a table, chosen by its largest number.

    Args:
        sizes: unit and number; signs do not matter.
    """
    largest: dict[str, float] = {}
    for unit, size in sizes:
        largest[unit] = max(largest.get(unit, 0.0), abs(size))
    return {unit: fitting(unit, size) for unit, size in largest.items()}


def three_digits(value: float) -> str:
    """Format three digits, without a power of ten for large numbers: ``0.98``, ``19.1``, ``12200``."""
    short = f"{value:.3g}"
    return f"{float(short):.10g}" if "e+" in short else short
