"""Names of parameters in words, the units that they carry as suffixes, and units in which numbers are easy to read."""

import re
from collections.abc import Iterable

TOKENS = {
    "Nm": "N m", "Nms": "N m s", "Ns": "N s", "Ns2": "N s^2",
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
    """A unit in which numbers of up to a size are easy to read, and the factor to it."""
    if largest < 1e-4 and unit in SMALLER:
        return SMALLER[unit]
    return SMALL[unit] if largest < 0.1 and unit in SMALL else (unit, 1.0)


def one_each(sizes: Iterable[tuple[str, float]]) -> dict[str, Shown]:
    """For every unit of a table the one in which all its numbers are shown: that which fits the largest.

    Args:
        sizes: unit and number; signs do not matter.
    """
    largest: dict[str, float] = {}
    for unit, size in sizes:
        largest[unit] = max(largest.get(unit, 0.0), abs(size))
    return {unit: fitting(unit, size) for unit, size in largest.items()}
