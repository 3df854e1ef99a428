"""Units of logged quantities, their sizes in SI, and the numbers that some of them need."""

import math
from collections.abc import Sequence

from estimator.errors import InputError
from estimator.strict import Fields

FACTORS: dict[str, dict[str, float]] = {
    "angle": {"rad": 1.0, "deg": math.pi / 180.0, "turn": 2.0 * math.pi},
    "length": {"m": 1.0, "mm": 1e-3, "um": 1e-6},
    "angular velocity": {
        "rad/s": 1.0, "deg/s": math.pi / 180.0, "rpm": math.pi / 30.0, "turn/s": 2.0 * math.pi,
        "0.229 rpm": 0.229 * math.pi / 30.0,
    },
    "speed": {"m/s": 1.0, "mm/s": 1e-3},
    "torque": {"Nm": 1.0, "N m": 1.0, "mNm": 1e-3, "mN m": 1e-3, "Nmm": 1e-3, "N mm": 1e-3, "kNm": 1e3},
    "force": {"N": 1.0, "mN": 1e-3, "kN": 1e3},
    "current": {"A": 1.0, "mA": 1e-3, "2.69 mA": 2.69e-3},
    "duty": {"1": 1.0, "%": 0.01, "permille": 0.001},
    "voltage": {"V": 1.0, "mV": 1e-3, "0.1 V": 0.1},
    "flag": {"1": 1.0},
}  # fmt: skip
"""Sizes by dimension; units of 0.229 rpm, 2.69 mA and 0.1 V are those of Dynamixel servos."""
COUNTS = "counts"
"""Counts of an encoder need ``counts_per_turn`` (per metre for a slide), those of a duty ``full_scale``."""
RATED = {"%": 0.01, "permille": 0.001, "V": 1.0}
"""Units that are shares of a ``rated`` torque, force or current; ``%`` of a position, too."""
_RATED = {
    **dict.fromkeys(("torque", "force", "current"), tuple(RATED)),
    **dict.fromkeys(("angle", "length"), ("%",)),
}
NUMBERED = ("counts_per_turn", "full_scale", "rated")  # keys for numbers that belong to a unit
TIME_UNITS: dict[str, int] = {"s": 1_000_000_000, "ms": 1_000_000, "us": 1_000, "ns": 1}
"""Nanoseconds per unit of time."""
DATES = "iso"  # unit of time for ISO 8601 dates instead of numbers, or a column of timestamps


def units_of(dimension: str) -> tuple[str, ...]:
    """Return every unit of a dimension, a key of ``FACTORS``."""
    counted = (COUNTS,) if dimension in ("angle", "length", "duty") else ()
    return (*FACTORS[dimension], *counted, *_RATED.get(dimension, ()))


def si_factor(fields: Fields, dimension: str, allowed: Sequence[str], noun: str) -> float:
    """Return the size in SI of ``unit``, one of the allowed ones, with the number of ``NUMBERED`` that it needs.

    ``noun`` names the quantity in messages, in the plural.
    """
    unit, where = fields.values["unit"], fields.where
    if unit not in allowed:
        raise InputError(f"{where}: unit is {unit!r:.40}; {noun} come in {', '.join(allowed)}")
    needed = None
    if unit == COUNTS:
        needed = "full_scale" if dimension == "duty" else "counts_per_turn"
    elif unit in _RATED.get(dimension, ()):
        needed = "rated"
    for key in NUMBERED:
        if key in fields and key != needed:
            raise InputError(f"{where}: {key} does not go with {noun} in {unit!r}; leave it out")
    if needed is None:
        return FACTORS[dimension][unit]
    if needed not in fields:
        raise InputError(f"{where}: missing key {needed!r}, which goes with unit {unit!r}")
    size = fields.number(needed, above=0.0)
    if needed == "rated":
        return size * RATED[unit]
    return (2.0 * math.pi if dimension == "angle" else 1.0) / size
