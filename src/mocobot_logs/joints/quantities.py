"""What a column of a joint log can hold, and the units that it may come in."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from estimator.errors import InputError

Kind = Literal["position", "velocity", "effort", "current", "duty", "voltage", "flag"]


@dataclass(frozen=True)
class Quantity:
    """One kind of column.

    Attributes:
        kind: what it measures.
        motor: whether it is of the motor's side of the gear.
        shared: whether it is one column of the robot, not one of each joint.
    """

    kind: Kind
    motor: bool = False
    shared: bool = False


QUANTITIES: dict[str, Quantity] = {
    "q": Quantity("position"),
    "motor_position": Quantity("position", motor=True),
    "dq": Quantity("velocity"),
    "motor_velocity": Quantity("velocity", motor=True),
    "torque": Quantity("effort"),
    "link_torque": Quantity("effort"),
    "motor_torque": Quantity("effort", motor=True),
    "current": Quantity("current", motor=True),
    "command": Quantity("position"),
    "motor_command": Quantity("position", motor=True),
    "duty": Quantity("duty", motor=True),
    "motor_voltage": Quantity("voltage", motor=True),
    "supply": Quantity("voltage", shared=True),
    "enabled": Quantity("flag", shared=True),
}
"""By the name of its channel in a map; a command is of the kind that ``[control] command`` says."""
POSITIONS = ("q", "motor_position")
VELOCITIES = ("dq", "motor_velocity")
EFFORTS = ("torque", "link_torque", "motor_torque", "current")
COMMANDS = ("command", "motor_command")
DUTIES = ("duty", "motor_voltage")

COUNTS, RATED = "counts", {"%": 0.01, "permille": 0.001, "V": 1.0}
"""Units that need a number more: ``counts_per_turn`` or ``full_scale``; ``rated``, with the share of it that one is."""
_TURNING: dict[str, dict[str, float]] = {
    "position": {"rad": 1.0, "deg": math.pi / 180.0, "turn": 2.0 * math.pi},
    "velocity": {
        "rad/s": 1.0, "deg/s": math.pi / 180.0, "rpm": math.pi / 30.0, "turn/s": 2.0 * math.pi
    },
    "effort": {"Nm": 1.0, "N m": 1.0, "mNm": 1e-3, "mN m": 1e-3, "Nmm": 1e-3, "N mm": 1e-3, "kNm": 1e3},
}  # fmt: skip
_SLIDING: dict[str, dict[str, float]] = {
    "position": {"m": 1.0, "mm": 1e-3, "um": 1e-6},
    "velocity": {"m/s": 1.0, "mm/s": 1e-3},
    "effort": {"N": 1.0, "mN": 1e-3, "kN": 1e3},
}
_ANY: dict[str, dict[str, float]] = {
    "current": {"A": 1.0, "mA": 1e-3},
    "duty": {"1": 1.0, "%": 0.01, "permille": 0.001},
    "voltage": {"V": 1.0, "mV": 1e-3},
    "flag": {"1": 1.0},
}


def units_of(kind: Kind, *, slides: bool) -> tuple[str, ...]:
    """Units that a kind of column may come in, for a joint that slides or turns."""
    plain = tuple(_plain(kind, slides=slides))
    if kind in ("effort", "current"):
        return (*plain, *RATED)
    return (*plain, COUNTS) if kind in ("duty", "position") else plain


def si_factor(
    kind: Kind, unit: str, *, slides: bool, counts_per_turn: float | None, full_scale: float | None,
    rated: float | None, where: str,
) -> float:  # fmt: skip
    """Size of one unit in SI.

    Args:
        kind: of the column.
        unit: as the map has it.
        slides: whether the joint (or, for a motor's column, the motor) slides; else it turns.
        counts_per_turn: counts in one turn, or in one metre of a slide, for positions in ``counts``.
        full_scale: counts of a duty of 1.
        rated: torque [N m or N] or current [A] that ``%`` and ``permille`` are of, or that 1 V is.
        where: what to call the channel in messages.

    Raises:
        InputError: there is no such unit, or the number that belongs to it is missing or too much.
    """
    allowed = units_of(kind, slides=slides)
    if unit not in allowed:
        joint = "a sliding joint" if slides else "a turning joint"
        of = f" of {joint}" if kind in _SLIDING else ""
        raise InputError(f"{where}: unit is {unit!r:.40}; {_PLURAL[kind]}{of} come in {', '.join(allowed)}")
    needed = None
    if unit == COUNTS:
        needed = "full_scale" if kind == "duty" else "counts_per_turn"
    elif unit in RATED and kind in ("effort", "current"):
        needed = "rated"
    given = {"counts_per_turn": counts_per_turn, "full_scale": full_scale, "rated": rated}
    for name, value in given.items():
        if value is not None and name != needed:
            raise InputError(f"{where}: {name} does not go with {_PLURAL[kind]} in {unit!r}; leave it out")
    if needed is None:
        return _plain(kind, slides=slides)[unit]
    size = given[needed]
    if size is None:
        raise InputError(f"{where}: missing key {needed!r}, which goes with unit {unit!r}")
    if needed == "rated":
        return size * RATED[unit]
    return (1.0 if slides or needed == "full_scale" else 2.0 * math.pi) / size


_PLURAL: dict[Kind, str] = {
    "position": "positions",
    "velocity": "velocities",
    "effort": "torques",
    "current": "currents",
    "duty": "duties",
    "voltage": "voltages",
    "flag": "flags",
}


def _plain(kind: Kind, *, slides: bool) -> dict[str, float]:
    if kind in _ANY:
        return _ANY[kind]
    return (_SLIDING if slides else _TURNING)[kind]
