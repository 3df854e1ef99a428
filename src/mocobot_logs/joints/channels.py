"""Channels of a joint log's map: common ones with placeholders, and what single joints have of their own."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

from estimator.errors import InputError
from estimator.strict import Fields, check_known
from mocobot_logs.joints.joint_map import JointChannel
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
from mocobot_logs.map.parse import check_place, sign_of, table_of

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
