"""Units of a measured log: what each kind of channel may be logged in, and its size in SI."""

import math

from estimator.errors import InputError

ANGLE, LENGTH, TORQUE, FORCE = "angle", "length", "torque", "force"
COUNTS = "counts"
"""Encoder counts: an angle once ``counts_per_turn`` is known."""

_FACTORS: dict[str, dict[str, float]] = {
    ANGLE: {"rad": 1.0, "deg": math.pi / 180.0},
    LENGTH: {"m": 1.0, "mm": 1e-3},
    TORQUE: {"Nm": 1.0, "mNm": 1e-3, "N m": 1.0, "mN m": 1e-3},
    FORCE: {"N": 1.0, "mN": 1e-3},
}
_KINDS = {"phi": ANGLE, "theta": ANGLE, "tau": TORQUE, "h": LENGTH, "force": FORCE, "ref": LENGTH}

TIME_UNITS: dict[str, int] = {"s": 1_000_000_000, "ms": 1_000_000, "us": 1_000, "ns": 1}
"""Nanoseconds in one unit of time."""
DATES = "iso"
"""Dates and times of ISO 8601 in the place of numbers, or a column of time stamps."""


def kind_of(channel: str) -> str:
    """What a channel measures: an angle, a length, a torque or a force.

    Args:
        channel: name such as ``phi1``, ``theta_z`` or ``force_x``.
    """
    return _KINDS[channel.partition("_")[0].rstrip("123")]


def units_of(channel: str) -> tuple[str, ...]:
    """Units in which a channel may be logged."""
    kind = kind_of(channel)
    return (*_FACTORS[kind], *([COUNTS] if kind == ANGLE else []))


def si_factor(channel: str, unit: str, counts_per_turn: float | None, where: str) -> float:
    """Size of one ``unit`` of a channel in SI.

    Args:
        channel: name of the channel.
        unit: one of ``units_of(channel)``.
        counts_per_turn: encoder counts in one turn of the joint, for ``counts``.
        where: what to call the channel in messages.

    Raises:
        InputError: the channel is not measured in that unit, or counts come without their number per turn.
    """
    if unit not in units_of(channel):
        allowed = ", ".join(units_of(channel))
        raise InputError(f"{where}: unit is {unit!r}; {kind_of(channel)}s are logged in {allowed}")
    if unit != COUNTS:
        return _FACTORS[kind_of(channel)][unit]
    if counts_per_turn is None:
        raise InputError(f"{where}: missing key 'counts_per_turn', which goes with unit 'counts'")
    return 2.0 * math.pi / counts_per_turn
