"""Units from the values of a channel, and whether a unit suits them."""

import numpy as np

from estimator.arrays import Array
from mocobot_logs.map.units import COUNTS, kind_of, si_factor

DOUBTFUL = "doubtful: "
"""Begins what a line that needs a look says."""


def printable(text: str) -> str:
    """Text as a comment may hold it: in one line, without control characters."""
    return "".join(c if c.isprintable() else " " for c in text)


_PLAUSIBLE = {"angle": 3.2, "torque": 60.0, "length": 1.5, "force": 600.0}
"""No arm's angle, torque, reach or force is larger [rad, N m, m, N]."""
_SURE = {"angle": (1.8, 10.0), "torque": (30.0, 200.0), "length": (1.0, 10.0), "force": (300.0, 2000.0)}
"""Values up to the first are in SI, from the second on in the smaller unit; between, either may be."""
_SMALLER = {"angle": "deg", "torque": "mNm", "length": "mm", "force": "mN"}
_SI = {"angle": "rad", "torque": "Nm", "length": "m", "force": "N"}
_COUNTS = 400.0
"""Whole numbers beyond are no degrees."""
_ONE_TURN = 0.01
"""Angles that cover a full turn to this share of it are those of an encoder that starts again there."""
_RATES_HZ = (10.0, 20_000.0)


def guess_unit(channel: str, values: Array) -> tuple[str, str | None]:
    """Unit of a channel by all its values, and what is doubtful about it."""
    kind = kind_of(channel)
    largest = float(np.max(np.abs(values), initial=0.0))
    if kind == "angle" and largest > _COUNTS and np.all(values == np.rint(values)):
        return COUNTS, "counts_per_turn must be filled in"
    if largest == 0.0:
        return _SI[kind], "it is zero throughout: which unit?"
    if kind == "angle" and abs(float(np.ptp(values)) / (2 * np.pi) - 1.0) < _ONE_TURN:
        return _SI[kind], "rad that jump by a full turn, which has to be taken out before? or deg?"
    si_up_to, smaller_from = _SURE[kind]
    if largest <= si_up_to:
        return _SI[kind], None
    doubt = None if largest >= smaller_from else f"{_SI[kind]} or {_SMALLER[kind]}?"
    return (_SMALLER[kind] if largest > _PLAUSIBLE[kind] else _SI[kind]), doubt


def doubt_unit(channel: str, unit: str, values: Array) -> str | None:
    """What speaks against a unit that a name tells."""
    if unit == COUNTS:
        return "counts_per_turn must be filled in"
    largest = float(np.max(np.abs(values), initial=0.0)) * si_factor(channel, unit, None, channel)
    kind = kind_of(channel)
    return (
        None
        if largest <= _PLAUSIBLE[kind]
        else f"{largest:.3g} {_SI[kind]} is no {kind} of an arm: which unit?"
    )


def guess_time(values: Array) -> tuple[str, str | None]:
    """Unit of time by the intervals between stamps, and what is doubtful about it."""
    steps = np.diff(values)
    steps = steps[steps > 0]
    step = float(np.median(steps)) if len(steps) else 0.0
    units = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
    fit = [unit for unit, size in units.items() if step and _RATES_HZ[0] <= 1 / (step * size) <= _RATES_HZ[1]]
    return (fit[0], None if len(fit) == 1 else f"{' or '.join(fit)}?") if fit else ("s", "which unit?")
