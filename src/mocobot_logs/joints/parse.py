"""From the TOML of a joint log's map to a ``JointMap``: every key known, every value allowed, nothing missing."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from estimator.errors import InputError
from estimator.strict import Fields, check_known
from mocobot_logs.joints.drives import OF_JOINT, Joints, control_of, gears_of
from mocobot_logs.joints.joint_map import Control, JointChannel, JointMap
from mocobot_logs.joints.quantities import (
    COMMANDS,
    COUNTS,
    DUTIES,
    EFFORTS,
    POSITIONS,
    QUANTITIES,
    VELOCITIES,
    Kind,
    si_factor,
    units_of,
)
from mocobot_logs.map.files import toml_values
from mocobot_logs.map.parse import check_place, csv_map, sign_of, table_of, time_map

KEYS = (
    "topic", "joint", "field", "column", "unit", "sign", "offset", "bits", "counts_per_turn", "full_scale", "rated"
)  # fmt: skip
_PLACES = ("topic", "joint", "field", "column")
_NUMBERED = ("counts_per_turn", "full_scale", "rated")
_PLACEHOLDERS = ("joint", "number", "index")
_COMMAND_KINDS: dict[str, Kind] = {"position": "position", "velocity": "velocity", "torque": "effort"}
MOST_BITS = 53

Channels = dict[tuple[str, str], JointChannel]


def channels_of(
    values: Mapping[str, Any], joints: Sequence[str], slides: Mapping[str, bool], command: str, where: str
) -> Channels:
    """Every channel of every joint.

    Args:
        values: the map.
        joints: in the order of the map.
        slides: whether each joint slides.
        command: what is commanded, see ``joint_log.Command``.
        where: what to call the map in messages.

    Raises:
        InputError: a key is unknown, a value not allowed, or a joint has one thing twice or no position.
    """
    defaults = table_of(values, "defaults", where)
    check_known(defaults, KEYS, f"{where}: defaults")
    common = _tables(table_of(values, "channels", where), f"{where}: channels")
    own = {
        joint: _tables(
            table_of(table_of(table_of(values, "joint", where), joint, f"{where}: joint"), "channels",
                     f"{where}: joint.{joint}"),
            f"{where}: joint.{joint}.channels",
        )
        for joint in joints
    }  # fmt: skip
    found: Channels = {}
    for index, joint in enumerate(joints):
        for name in dict.fromkeys([*common, *own[joint]]):
            table = own[joint].get(name, {})
            if QUANTITIES[name].shared:
                if name in own[joint]:
                    raise InputError(
                        f"{where}: joint.{joint}.channels: {name} is one column of the whole robot; put it in "
                        "[channels]"
                    )
                continue
            if table is None or (common.get(name, {}) is None and name not in own[joint]):
                continue
            inside = f"{where}: joint.{joint}.channels.{name}" if table else f"{where}: channels.{name}"
            merged = defaults | (common.get(name) or {}) | table
            place = {"joint": joint, "number": f"{index + 1}", "index": f"{index}"}
            found[name, joint] = _channel(name, merged, inside, place, slides[joint], command)
    for name, table in common.items():
        if QUANTITIES[name].shared and table is not None:
            found[name, ""] = _channel(
                name, defaults | table, f"{where}: channels.{name}", None, False, command
            )
    for joint in joints:
        _check_joint([name for name, of in found if of == joint], joint, where)
    return found


def _tables(tables: Mapping[str, Any], where: str) -> dict[str, dict[str, Any] | None]:
    """Tables by quantity; None for what is switched off with ``false``."""
    check_known(tables, tuple(QUANTITIES), where, "channel")
    found: dict[str, dict[str, Any] | None] = {}
    for name, table in tables.items():
        if table is False:
            found[name] = None
        elif isinstance(table, dict):
            check_known(table, KEYS, f"{where}.{name}")
            found[name] = table
        else:
            raise InputError(
                f"{where}: {name} is {table!r:.40}; it must be a table, or false where a joint has none"
            )
    return found


def _check_joint(names: Sequence[str], joint: str, where: str) -> None:
    for group, what in (
        (EFFORTS, "torque"),
        (VELOCITIES, "velocity"),
        (COMMANDS, "command"),
        (DUTIES, "duty"),
    ):
        given = [name for name in names if name in group]
        if len(given) > 1:
            raise InputError(
                f"{where}: joint {joint} has {' and '.join(given)}; one {what} of a joint is used, so leave out "
                f"the others (joint.{joint}.channels.{given[-1]} = false)"
            )
    if not any(name in POSITIONS for name in names):
        raise InputError(
            f"{where}: joint {joint} has no position; it needs a channel {' or '.join(POSITIONS)}"
        )


def _channel(
    name: str,
    values: Mapping[str, Any],
    where: str,
    place: Mapping[str, str] | None,
    slides: bool,
    command: str,
) -> JointChannel:
    quantity, merged = QUANTITIES[name], dict(values)
    kind: Kind = _COMMAND_KINDS.get(command, "position") if name in COMMANDS else quantity.kind
    if kind == "flag":
        merged.setdefault("unit", "1")
    if "unit" not in merged:
        raise InputError(
            f"{where}: missing key 'unit'; it is one of {', '.join(units_of(kind, slides=slides))}"
        )
    fields = Fields(merged, ("unit",), where, KEYS)
    unit = fields.text("unit")
    parts = {key: _text(fields, key, place) for key in _PLACES}
    check_place(parts, where)
    sign = sign_of(fields, merged)
    bits = merged.get("bits")
    if bits is not None and (type(bits) is not int or not 2 <= bits <= MOST_BITS):
        fields.refuse("bits", f"a whole number from 2 to {MOST_BITS}")
    # A motor turns or slides, whatever its joint does.
    slides = slides and not (quantity.motor and unit in units_of(kind, slides=False))
    numbered = {key: fields.number(key, above=0.0) if key in fields else None for key in _NUMBERED}
    factor = si_factor(kind, unit, slides=slides, where=where, **numbered)
    return JointChannel(
        topic=parts["topic"],
        joint=parts["joint"],
        field=parts["field"],
        column=parts["column"],
        scale=sign * factor,
        offset=fields.number("offset") if "offset" in fields else 0.0,
        bits=bits,
        counted=unit == COUNTS,
    )


def _text(fields: Fields, key: str, place: Mapping[str, str] | None) -> str | None:
    """Text with its placeholders filled."""
    if key not in fields:
        return None
    text = fields.text(key)
    for placeholder in re.findall(r"\{([^{}]*)\}", text):
        if place is None:
            raise InputError(
                f"{fields.where}: {key} holds the placeholder '{{{placeholder:.40}}}', but the robot has one such "
                "column; name it"
            )
        if placeholder not in place:
            valid = ", ".join(f"{{{name}}}" for name in _PLACEHOLDERS)
            raise InputError(
                f"{fields.where}: {key} holds the placeholder '{{{placeholder:.40}}}'; the placeholders are {valid}"
            )
    return re.sub(r"\{(\w+)\}", lambda found: (place or {})[found.group(1)], text)


VERSION = 1
LEAST_HZ, MOST_HZ = 20.0, 20e3
_OPTIONAL = ("version", "time", "csv", "defaults", "drive", "control", "joint", "log")


def read_joint_map(path: Path | str, joints: Sequence[str], slides: Sequence[bool]) -> JointMap:
    """A map from its file.

    Args:
        path: the file.
        joints: the model's joints.
        slides: whether each of them slides.

    Raises:
        InputError: there is no such file, it is not TOML, or not such a map.
    """
    return parse_joint_map(toml_values(Path(path)), str(path), joints, slides)


def parse_joint_map(
    values: Mapping[str, Any], name: str, joints: Sequence[str], slides: Sequence[bool]
) -> JointMap:
    """Check a map and bring it into shape.

    Args:
        values: the parsed TOML.
        name: what to call the map in messages.
        joints: the model's joints.
        slides: whether each of them slides.

    Raises:
        InputError: a key is unknown or missing, a value is not allowed, or the joints are not the model's.
    """
    where = f"map {name}"
    version = values.get("version", VERSION)
    if type(version) is not int or version != VERSION:
        raise InputError(f"{where}: version is {version!r:.40}; this program reads version {VERSION}")
    top = Fields(values, ("joints", "channels"), where, _OPTIONAL)
    named = _joints(top, joints)
    own = table_of(values, "joint", where)
    check_known(own, named, f"{where}: joint", "joint")
    for joint in own:
        check_known(table_of(own, joint, f"{where}: joint"), OF_JOINT, f"{where}: joint.{joint}")
    both = Joints(named, tuple(joints))
    control, overrides = control_of(values, both, where)
    turns, zero, constant = gears_of(values, both, where)
    channels = channels_of(
        values, named, dict(zip(joints, map(bool, slides), strict=True)), control.command, where
    )
    _check_together(channels, control, named, where)
    time = dict(table_of(values, "time", where))
    rate_hz = time.pop("rate_hz", None)
    if rate_hz is not None:
        rate_hz = Fields({"rate_hz": rate_hz}, ("rate_hz",), f"{where}: time").number("rate_hz", LEAST_HZ)
        if rate_hz > MOST_HZ:
            raise InputError(f"{where}: time: rate_hz is {rate_hz:g}; it must be at most {MOST_HZ:g}")
    found = JointMap(
        name=name,
        joints=tuple(joints),
        time=time_map(time, f"{where}: time"),
        rate_hz=rate_hz,
        csv=csv_map(table_of(values, "csv", where), f"{where}: csv"),
        channels=channels,
        turns=turns,
        zero=zero,
        torque_constant=constant,
        control=control,
        overrides=overrides,
    )
    if found.time.column is not None and "{" in found.time.column:
        raise InputError(f"{where}: time: column holds a placeholder; all joints share one column of time")
    return found


def _joints(top: Fields, model: Sequence[str]) -> tuple[str, ...]:
    """Names in the order of the log."""
    names = top.list("joints")
    if not all(isinstance(name, str) for name in names) or len(set(names)) < len(names):
        top.refuse("joints", "a list of distinct names of the model's joints")
    check_known(names, tuple(model), f"{top.where}: joints", "joint")
    missing = [joint for joint in model if joint not in names]
    if missing:
        raise InputError(
            f"{top.where}: joints lacks {', '.join(map(repr, missing[:8]))}; a map names every joint of the model "
            "(lock the others in the model by removing their joints)"
        )
    return tuple(names)


def _check_together(channels: Channels, control: Control, joints: Sequence[str], where: str) -> None:
    """What only makes sense with something else."""
    names = {name for name, _ in channels}
    if names & set(COMMANDS) and control.command == "none":
        raise InputError(
            f"{where}: control: missing key 'command', which says what the channel "
            f"{next(iter(names & set(COMMANDS)))} is: position, velocity or torque"
        )
    if names & set(COMMANDS) and control.command == "duty":
        raise InputError(
            f"{where}: control: command is 'duty', whose channel is duty or motor_voltage, not "
            f"{next(iter(names & set(COMMANDS)))}"
        )
    if control.command in ("position", "velocity", "torque") and not names & set(COMMANDS):
        raise InputError(
            f"{where}: control: command is {control.command!r}, but there is no channel command or motor_command"
        )
    if "motor_voltage" in names and control.supply_V is None and "supply" not in names:
        raise InputError(
            f"{where}: channels: motor_voltage needs the supply, a channel supply or control's key supply_V"
        )
    if not names & {*EFFORTS, *COMMANDS, *DUTIES}:
        listed = ", ".join((*EFFORTS, *COMMANDS, *DUTIES))
        raise InputError(
            f"{where}: no joint has a torque, a current, a command or a duty; without one there is nothing to compare "
            f"the model with (channels {listed})"
        )
    assert names <= set(QUANTITIES)
    assert names & set(POSITIONS)
    assert joints
