"""What a joint log's map says between the motors and the joints: gears, coupled drives, constants, the loop."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from estimator.arrays import Array
from estimator.errors import InputError
from estimator.strict import Fields, check_known, is_number
from mocobot_logs.joints.joint_map import COMMANDS, GAINS, Control, Override
from mocobot_logs.map.parse import table_of

FREE = "free"
DRIVE = ("gear", "zero", "torque_constant")
GAIN = ("position_gain", "velocity_gain", "limit")
OF_JOINT = (*DRIVE, *GAIN, "channels")
"""Keys of the table of one joint."""
_OF_LOG = ("match", *GAIN, "supply_V")
_LEAST_RECIPROCAL_CONDITION = 1e-9
_UNKNOWN = float("nan")


@dataclass(frozen=True)
class Joints:
    """The joints of a map.

    Attributes:
        named: in the map's order.
        model: in the model's order.
    """

    named: Sequence[str]
    model: Sequence[str]

    def sorted(self, values: Sequence[float]) -> Array:
        """Values in the map's order brought to the model's, shape (J,)."""
        by_name = dict(zip(self.named, values, strict=True))
        return np.array([by_name[joint] for joint in self.model], dtype=float)


def gears_of(values: Mapping[str, Any], joints: Joints, where: str) -> tuple[Array, Array, Array]:
    """Motor positions from joint positions (J, J), zeros [rad or m] (J,), torque constants [N m/A] (J,).

    Args:
        values: the map.
        joints: its joints.
        where: what to call the map in messages.

    Raises:
        InputError: a value is not allowed, or motors cannot tell where the joints are.
    """
    inside = f"{where}: drive"
    drive = table_of(values, "drive", where)
    check_known(drive, (*DRIVE, "coupling"), inside)
    gear = _per_joint(values, drive, "gear", 1.0, joints, where, inside, _nonzero)
    zero = _per_joint(values, drive, "zero", 0.0, joints, where, inside, _any)
    constant = _per_joint(values, drive, "torque_constant", 1.0, joints, where, inside, _constant)
    turns = np.diag(gear)
    coupling = drive.get("coupling", {})
    if isinstance(coupling, list):
        given = [inside_of for inside_of in ("gear",) if inside_of in drive]
        if given:
            raise InputError(f"{inside}: coupling is a matrix, which has the gears in it; leave out gear")
        n = len(joints.named)
        matrix = Fields(drive, (), inside, tuple(drive)).array("coupling", (n, n))
        order = [list(joints.named).index(joint) for joint in joints.model]
        turns = matrix[np.ix_(order, order)]
    else:
        turns = turns + _coupled(coupling, joints, f"{inside}: coupling", drive)
    if not np.isfinite(np.linalg.cond(turns)) or 1.0 / np.linalg.cond(turns) < _LEAST_RECIPROCAL_CONDITION:
        raise InputError(
            f"{inside}: coupling is singular; where the motors are must tell where the joints are"
        )
    return turns, zero, constant


def control_of(values: Mapping[str, Any], joints: Joints, where: str) -> tuple[Control, tuple[Override, ...]]:
    """How the robot is commanded, and what differs in single logs.

    Args:
        values: the map.
        joints: its joints.
        where: what to call the map in messages.

    Raises:
        InputError: a key is unknown, or a value not allowed.
    """
    inside = f"{where}: control"
    table = table_of(values, "control", where)
    fields = Fields(table, (), inside, ("command", "gain_of", "supply_V", *GAIN))
    gains = {key: _per_joint(values, table, key, _UNKNOWN, joints, where, inside, _positive) for key in GAIN}
    control = Control(
        command=fields.one_of("command", COMMANDS) if "command" in fields else "none",
        gain_of=fields.one_of("gain_of", GAINS) if "gain_of" in fields else "torque",
        supply_V=fields.number("supply_V", above=0.0) if "supply_V" in fields else None,
        **gains,
    )
    logs = values.get("log", [])
    if not isinstance(logs, list) or not all(isinstance(log, dict) for log in logs):
        raise InputError(f"{where}: log is {logs!r:.40}; it must be tables, [[log]]")
    return control, tuple(
        _override(log, values, joints, f"{where}: log {number}") for number, log in enumerate(logs, 1)
    )


def _override(log: Mapping[str, Any], values: Mapping[str, Any], joints: Joints, where: str) -> Override:
    fields = Fields(log, ("match",), where, _OF_LOG)
    found: dict[str, object] = {
        key: _per_joint({}, log, key, _UNKNOWN, joints, where, where, _positive) for key in GAIN if key in log
    }
    if "supply_V" in fields:
        found["supply_V"] = fields.number("supply_V", above=0.0)
    if not found:
        raise InputError(f"{where}: says nothing; give it one of {', '.join(_OF_LOG[1:])}")
    return Override(fields.text("match"), found)


Check = Callable[[Any], float | None]


def _per_joint(
    values: Mapping[str, Any], table: Mapping[str, Any], key: str, default: float, joints: Joints, where: str,
    inside: str, check: tuple[Check, str],
) -> Array:  # fmt: skip
    """Numbers of the joints: one for all, or a list in the map's order; single joints may have their own."""
    convert, allowed = check
    given = table.get(key, default)
    count = len(joints.named)
    listed = given if isinstance(given, list) else [given] * count
    if len(listed) != count:
        raise InputError(
            f"{inside}: {key} has {len(listed)} entries; it must have {count}, one for each joint, or be one number"
        )
    found = []
    own = table_of(values, "joint", where)
    for joint, value in zip(joints.named, listed, strict=True):
        of_joint = table_of(own, joint, f"{where}: joint")
        here = f"{where}: joint.{joint}" if key in of_joint else inside
        value = of_joint.get(key, value)
        number = default if value is default else convert(value)
        if number is None:
            raise InputError(f"{here}: {key} is {value!r:.60}; it must be {allowed}")
        found.append(number)
    return joints.sorted(found)


def _coupled(coupling: Any, joints: Joints, where: str, drive: Mapping[str, Any]) -> Array:
    """Motor turns per turn of other joints than their own, in the model's order, shape (J, J)."""
    if not isinstance(coupling, dict):
        raise InputError(
            f"{where} is {coupling!r:.40}; it must be a matrix (motors by joints) or tables such as "
            "joint_6 = { joint_5 = 32.0 }"
        )
    del drive
    model = list(joints.model)
    found = np.zeros((len(model), len(model)))
    check_known(coupling, tuple(joints.named), where, "joint")
    for motor, row in coupling.items():
        if not isinstance(row, dict):
            raise InputError(
                f"{where}: {motor} is {row!r:.40}; it must be a table, motor turns by turn of a joint"
            )
        check_known(row, [joint for joint in joints.named if joint != motor], f"{where}.{motor}", "joint")
        for joint, ratio in row.items():
            if not is_number(ratio):
                raise InputError(f"{where}.{motor}: {joint} is {ratio!r:.40}; it must be a finite number")
            found[model.index(motor), model.index(joint)] = ratio
    return found


def _number(value: Any) -> float | None:
    return float(value) if is_number(value) else None


def _positive_number(value: Any) -> float | None:
    number = _number(value)
    return number if number is not None and number > 0 else None


_any: tuple[Check, str] = (_number, "a finite number")
_nonzero: tuple[Check, str] = (
    lambda value: _number(value) or None,
    "a number of motor turns per joint turn, not 0",
)
_positive: tuple[Check, str] = (_positive_number, "a positive number")
_constant: tuple[Check, str] = (
    lambda value: _UNKNOWN if value == FREE else _positive_number(value),
    'a positive number of newton metres per ampere, or "free"',
)
