"""Maps of one robot's joint logs: quantity and joint of each column, and the transmission between motors and joints."""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np

from estimator.arrays import Array
from estimator.errors import InputError
from estimator.strict import Fields, check_known, is_number
from mocobot_logs import units
from mocobot_logs.joints.joint_log import Command, GainOf
from mocobot_logs.maps import (
    PLACES,
    ChannelMap,
    CsvMap,
    LogMap,
    TimeMap,
    check_version,
    parse_channel,
    parse_csv,
    parse_time,
    read_toml_map,
    table_of,
)

Kind = Literal["position", "velocity", "effort", "current", "duty", "voltage", "flag"]


@dataclass(frozen=True)
class Quantity:
    kind: Kind  # what it measures
    motor: bool = False  # whether it is measured on the motor's side of the gear
    shared: bool = False  # whether the robot has one such column, not one per joint


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
    "command_velocity": Quantity("velocity"),
    "feedforward": Quantity("effort"),
    "duty": Quantity("duty", motor=True),
    "motor_voltage": Quantity("voltage", motor=True),
    "supply": Quantity("voltage", shared=True),
    "enabled": Quantity("flag", shared=True),
}
"""Quantities by channel name in a map; ``[control] command`` sets the kind of a command."""
POSITIONS = ("q", "motor_position")
VELOCITIES = ("dq", "motor_velocity")
EFFORTS = ("torque", "link_torque", "motor_torque", "current")
COMMANDS = ("command", "motor_command")
DUTIES = ("duty", "motor_voltage")
ORDERS = (*COMMANDS, "command_velocity", "feedforward")
"""Quantities that the robot is told, and that hold until it is told others."""
KEYS = (*PLACES, "unit", "sign", "offset", "bits", *units.NUMBERED)  # keys of a channel
MOST_BITS = 53
LEAST_HZ, MOST_HZ = 20.0, 20e3
_DIMENSIONS: dict[Kind, tuple[str, str, str]] = {
    "position": ("positions", "angle", "length"),
    "velocity": ("velocities", "angular velocity", "speed"),
    "effort": ("torques", "torque", "force"),
    "current": ("currents", "current", "current"),
    "duty": ("duties", "duty", "duty"),
    "voltage": ("voltages", "voltage", "voltage"),
    "flag": ("flags", "flag", "flag"),
}
"""Plural, and dimension for a turning and for a sliding joint."""
BETWEEN = ("held", "interpolated")  # what the robot does between two commands
COMMAND_KINDS: dict[str, Kind] = {"position": "position", "velocity": "velocity", "torque": "effort"}
_PLACEHOLDERS = ("joint", "number", "index")
_OPTIONAL = ("version", "time", "csv", "defaults", "drive", "control", "joint", "log")
_DRIVE = ("gear", "zero", "torque_constant")
_GAIN = ("position_gain", "velocity_gain", "limit")
_LOOP = (*_GAIN, "gain_known_within", "delay_s")
_OF_JOINT = (*_DRIVE, *_LOOP, "channels")
_OF_LOG = ("match", *_GAIN, "supply_V")
_LEAST_RECIPROCAL_CONDITION = 1e-9
_UNKNOWN = float("nan")


def units_of(kind: Kind, *, slides: bool) -> tuple[str, ...]:
    """Return the units allowed for a kind of column of a sliding or turning joint."""
    return units.units_of(_DIMENSIONS[kind][1 + slides])


@dataclass(frozen=True, eq=False)
class Control:
    """How the robot is commanded; unknown numbers are NaN, but for ``supply_V``."""

    command: Command  # what the logged commands are: one of ``Command``
    # position_gain, velocity_gain: see ``joint_log.Drive``, shape (J,); infinity where free
    position_gain: Array
    velocity_gain: Array
    gain_of: GainOf  # what the loop outputs, gain times error: one of ``GainOf``
    limit: Array  # largest output of the loop, in the quantity of ``gain_of``, shape (J,)
    supply_V: float | None  # nominal supply voltage, or None
    gain_known_within: Array  # factor within which gains that are not free are known, shape (J,)
    delay_s: Array  # see ``joint_log.Drive``, shape (J,)
    held: bool  # whether commands hold until the next one; else they are interpolated


Channels = dict[tuple[str, str], ChannelMap]


@dataclass(frozen=True, eq=False)
class JointMap:
    """A complete, checked map with joints in the model's order."""

    name: str  # name of the map in messages
    joints: tuple[str, ...]  # names of the J joints in the model
    time: TimeMap  # location of the time
    rate_hz: float | None  # rate of the grid [Hz], or None for the log's own
    csv: CsvMap  # form of a text table
    # by quantity and joint; the joint is "" for a quantity of the whole robot
    channels: Mapping[tuple[str, str], ChannelMap]
    turns: Array  # matrix from joint to motor positions, with gears and coupled drives, shape (J, J)
    zero: Array  # added to positions on the joint's side of the gear [rad or m], shape (J,)
    torque_constant: Array  # torque constants [N m/A], NaN where free, shape (J,)
    control: Control  # how the robot is commanded
    # file name patterns with the entries of ``control`` that they change; later ones override
    overrides: tuple[tuple[str, Mapping[str, Any]], ...] = ()

    def control_of(self, file_name: str) -> Control:
        """Return how the robot is commanded in the log with that file name."""
        control = self.control
        for pattern, differs in self.overrides:
            if fnmatchcase(file_name, pattern):
                control = replace(control, **differs)
        return control

    @property
    def held(self) -> tuple[bool, ...]:
        """Whether each channel holds its value until the next one."""
        return tuple(self.control.held and quantity in ORDERS for quantity, _ in self.channels)

    def of_source(self) -> LogMap:
        """Return the map in the form that readers of logs use: one robot with all channels in order."""
        mapped = {
            label(*key): replace(channel, optional=key[0] not in POSITIONS, held=held)
            for (key, channel), held in zip(self.channels.items(), self.held, strict=True)
        }
        return LogMap(self.name, "joint", 1, None, self.time, self.csv, mapped, required=tuple(mapped))


def label(quantity: str, joint: str) -> str:
    """Return the name of a channel in messages."""
    return f"{quantity} of {joint}" if joint else quantity


def read_joint_map(path: Path | str, joints: Sequence[str], slides: Sequence[bool]) -> JointMap:
    """Read a map from its TOML file for a model's joints; see ``parse_joint_map``."""
    return parse_joint_map(read_toml_map(Path(path)), str(path), joints, slides)


def parse_joint_map(
    values: Mapping[str, Any], name: str, joints: Sequence[str], slides: Sequence[bool]
) -> JointMap:
    """Check and parse the TOML values of a map for a model's joints; ``slides`` tells which of them slide."""
    where = f"map {name}"
    check_version(values, where)
    top = Fields(values, ("joints", "channels"), where, _OPTIONAL)
    named = _joint_names(top, joints)
    tables = table_of(values, "joint", where)
    check_known(tables, named, f"{where}: joint", "joint")
    own = {joint: table_of(tables, joint, f"{where}: joint") for joint in tables}
    for joint, table in own.items():
        check_known(table, _OF_JOINT, f"{where}: joint.{joint}")
    per_joint = _PerJoint(where, named, tuple(joints), own)
    control, overrides = _control(values, per_joint)
    turns, zero, constant = _gears(values, per_joint)
    slide = dict(zip(joints, map(bool, slides), strict=True))
    channels = _channels(values, per_joint, slide, control.command)
    _check_together(channels, control, where)
    time = dict(table_of(values, "time", where))
    rate_hz = time.pop("rate_hz", None)
    if rate_hz is not None:
        rate_hz = Fields({"rate_hz": rate_hz}, ("rate_hz",), f"{where}: time").number("rate_hz", LEAST_HZ)
        if rate_hz > MOST_HZ:
            raise InputError(f"{where}: time: rate_hz is {rate_hz:g}; it must be at most {MOST_HZ:g}")
    found = JointMap(
        name=name,
        joints=tuple(joints),
        time=parse_time(time, f"{where}: time"),
        rate_hz=rate_hz,
        csv=parse_csv(table_of(values, "csv", where), f"{where}: csv"),
        channels=channels,
        turns=turns,
        zero=zero,
        torque_constant=constant,
        control=control,
        overrides=overrides,
    )
    if "{" in f"{found.time.column}{found.time.nanosec}":
        raise InputError(f"{where}: time: column holds a placeholder; all joints share one column of time")
    return found


def _joint_names(top: Fields, model: Sequence[str]) -> tuple[str, ...]:
    names = top.list("joints")
    if not all(isinstance(name, str) for name in names) or len(set(names)) < len(names):
        top.refuse("joints", "a list of distinct names of the model's joints")
    check_known(names, tuple(model), f"{top.where}: joints", "joint")
    missing = [joint for joint in model if joint not in names]
    if missing:
        raise InputError(
            f"{top.where}: joints lacks {', '.join(map(repr, missing[:8]))}; a map names every joint of the model; "
            f"lock those that do not move, such as --lock {shlex.quote(f'{missing[0]}=0')}, or name the arm's first "
            "body by --base"
        )
    return tuple(names)


# Channels.


def _channels(
    values: Mapping[str, Any], joints: _PerJoint, slides: Mapping[str, bool], command: str
) -> Channels:
    """Return every channel of every joint in the map's order, then the channels of the whole robot."""
    where = joints.where
    defaults = table_of(values, "defaults", where)
    check_known(defaults, KEYS, f"{where}: defaults")
    common = _channel_tables(table_of(values, "channels", where), f"{where}: channels")
    found: Channels = {}
    for index, joint in enumerate(joints.named):
        inside = f"{where}: joint.{joint}"
        own = _channel_tables(table_of(joints.own.get(joint, {}), "channels", inside), f"{inside}.channels")
        fill = {"joint": joint, "number": f"{index + 1}", "index": f"{index}"}
        for name in dict.fromkeys([*common, *own]):
            if QUANTITIES[name].shared:
                if name in own:
                    raise InputError(
                        f"{inside}.channels: {name} is one column of the whole robot; put it in [channels]"
                    )
                continue
            table = own.get(name, {})
            if table is None or (common.get(name, {}) is None and name not in own):
                continue
            fields = Fields(
                _with_unit(name, defaults | (common.get(name) or {}) | table),
                (),
                f"{inside}.channels.{name}" if table else f"{where}: channels.{name}",
                KEYS,
            )
            channel = _joint_channel(name, fields, _PLACEHOLDERS, slides[joint], command)
            found[name, joint] = channel.filled(
                lambda text, fill=fill: re.sub(r"\{(\w+)\}", lambda at: fill[at[1]], text)
            )
    for name, table in common.items():
        if QUANTITIES[name].shared and table is not None:
            fields = Fields(_with_unit(name, defaults | table), (), f"{where}: channels.{name}", KEYS)
            found[name, ""] = _joint_channel(name, fields, (), False, command)
    for joint in joints.named:
        _check_joint([name for name, of in found if of == joint], joint, where)
    return found


def _channel_tables(tables: Mapping[str, Any], where: str) -> dict[str, dict[str, Any] | None]:
    """Return the tables by quantity; None for a quantity set to ``false``."""
    check_known(tables, tuple(QUANTITIES), where, "channel")
    for name, table in tables.items():
        if isinstance(table, dict):
            check_known(table, KEYS, f"{where}.{name}")
        elif table is not False:
            raise InputError(
                f"{where}: {name} is {table!r:.40}; it must be a table, or false where a joint has none"
            )
    return {name: None if table is False else table for name, table in tables.items()}


def _with_unit(name: str, table: Mapping[str, Any]) -> dict[str, Any]:
    return {"unit": "1", **table} if QUANTITIES[name].kind == "flag" else dict(table)


def _joint_channel(
    name: str, fields: Fields, placeholders: Sequence[str], slides: bool, command: str
) -> ChannelMap:
    quantity = QUANTITIES[name]
    kind: Kind = COMMAND_KINDS.get(command, "position") if name in COMMANDS else quantity.kind
    if "unit" not in fields:
        raise InputError(
            f"{fields.where}: missing key 'unit'; it is one of {', '.join(units_of(kind, slides=slides))}"
        )
    # A motor may turn although its joint slides.
    slides = slides and not (quantity.motor and fields.text("unit") in units_of(kind, slides=False))
    plural, *dimensions = _DIMENSIONS[kind]
    is_of = f" of a {'sliding' if slides else 'turning'} joint" if dimensions[0] != dimensions[1] else ""
    allowed = units_of(kind, slides=slides)
    channel = parse_channel(fields, placeholders, dimensions[slides], allowed, f"{plural}{is_of}")
    bits = fields.values.get("bits")
    if bits is not None and (type(bits) is not int or not 2 <= bits <= MOST_BITS):
        fields.refuse("bits", f"a whole number from 2 to {MOST_BITS}")
    return replace(channel, bits=bits)


def _check_joint(names: Sequence[str], joint: str, where: str) -> None:
    """Check that a joint has a position and at most one torque, velocity, command and duty."""
    groups = {"torque": EFFORTS, "velocity": VELOCITIES, "command": COMMANDS, "duty": DUTIES}
    for what, group in groups.items():
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


def _check_together(channels: Channels, control: Control, where: str) -> None:
    """Check the channels against each other and against the control."""
    names = {name for name, _ in channels}
    commands = names & set(COMMANDS)
    if commands and control.command == "none":
        raise InputError(
            f"{where}: control: missing key 'command', which says what the channel {next(iter(commands))} is: "
            "position, velocity or torque"
        )
    if commands and control.command == "duty":
        raise InputError(
            f"{where}: control: command is 'duty', whose channel is duty or motor_voltage, not {next(iter(commands))}"
        )
    if control.command in COMMAND_KINDS and not commands:
        raise InputError(
            f"{where}: control: command is {control.command!r}, but there is no channel command or motor_command"
        )
    for name, needed in (("feedforward", ("position", "velocity")), ("command_velocity", ("position",))):
        if name in names and control.command not in needed:
            raise InputError(
                f"{where}: channels: {name} goes with a command of a {' or '.join(needed)}; control's key command is "
                f"{control.command!r}"
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


# Gears, coupled drives, torque constants and the loop.


_RULES: dict[str, tuple[float, float | None, Callable[[float], bool], str]] = {
    "gear": (1.0, None, lambda x: x != 0, "a number of motor turns per joint turn, not 0"),
    "zero": (0.0, None, lambda x: True, "a finite number"),
    "torque_constant": (
        1.0, _UNKNOWN, lambda x: x > 0, 'a positive number of newton metres per ampere, or "free"'
    ),
    "position_gain": (_UNKNOWN, np.inf, lambda x: x > 0, 'a positive number, or "free"'),
    "velocity_gain": (_UNKNOWN, np.inf, lambda x: x >= 0, 'a number, not negative, or "free"'),
    "limit": (_UNKNOWN, None, lambda x: x > 0, "a positive number"),
    "gain_known_within": (1.0, None, lambda x: x >= 1, "a factor of at least 1, such as 2 for half to twice the gain"),
    "delay_s": (_UNKNOWN, None, lambda x: x >= 0, "a number of seconds, not negative"),
}  # fmt: skip
"""By key of a joint: default, what "free" stands for (None: not allowed), which numbers are allowed, and in words."""


@dataclass(frozen=True)
class _PerJoint:
    """Reads the numbers of the joints."""

    where: str  # name of the map in messages
    named: tuple[str, ...]  # joints in the map's order
    model: tuple[str, ...]  # joints in the model's order
    own: Mapping[str, Mapping[str, Any]]  # tables of single joints

    def read(self, table: Mapping[str, Any], key: str, inside: str) -> Array:
        """Return a value per joint in the model's order, shape (J,).

        A table gives one number for all joints or a list in the map's order; tables of single joints override it.
        """
        default, free, allows, allowed = _RULES[key]
        given = table.get(key, default)
        count = len(self.named)
        listed = given if isinstance(given, list) else [given] * count
        if len(listed) != count:
            raise InputError(
                f"{inside}: {key} has {len(listed)} entries; it must have {count}, one for each joint, or be one number"
            )
        found = {}
        for joint, value in zip(self.named, listed, strict=True):
            own = self.own.get(joint, {})
            value = own.get(key, value)
            if value == "free" and free is not None:
                value = free
            elif value is not default and not (is_number(value) and allows(value)):
                here = f"{self.where}: joint.{joint}" if key in own else inside
                raise InputError(f"{here}: {key} is {value!r:.60}; it must be {allowed}")
            found[joint] = value
        return np.array([found[joint] for joint in self.model], dtype=float)


def _gears(values: Mapping[str, Any], joints: _PerJoint) -> tuple[Array, Array, Array]:
    """Return motor from joint positions (J, J), zeros [rad or m] (J,) and torque constants [N m/A] (J,)."""
    inside = f"{joints.where}: drive"
    drive = table_of(values, "drive", joints.where)
    check_known(drive, (*_DRIVE, "coupling"), inside)
    gear, zero, constant = (joints.read(drive, key, inside) for key in _DRIVE)
    coupling = drive.get("coupling", {})
    if isinstance(coupling, list):
        if "gear" in drive:
            raise InputError(f"{inside}: coupling is a matrix, which has the gears in it; leave out gear")
        n = len(joints.named)
        matrix = Fields(drive, (), inside, tuple(drive)).array("coupling", (n, n))
        order = [joints.named.index(joint) for joint in joints.model]
        turns = matrix[np.ix_(order, order)]
    else:
        turns = np.diag(gear) + _coupled(coupling, joints, f"{inside}: coupling")
    condition = np.linalg.cond(turns)
    if not np.isfinite(condition) or 1.0 / condition < _LEAST_RECIPROCAL_CONDITION:
        raise InputError(
            f"{inside}: coupling is singular; where the motors are must tell where the joints are"
        )
    return turns, zero, constant


def _coupled(coupling: Any, joints: _PerJoint, where: str) -> Array:
    """Return the off-diagonal motor turns per joint turn, in the model's order, shape (J, J)."""
    if not isinstance(coupling, dict):
        raise InputError(
            f"{where} is {coupling!r:.40}; it must be a matrix (motors by joints) or tables such as "
            "joint_6 = { joint_5 = 32.0 }"
        )
    model = joints.model
    found = np.zeros((len(model), len(model)))
    check_known(coupling, joints.named, where, "joint")
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


def _control(
    values: Mapping[str, Any], joints: _PerJoint
) -> tuple[Control, tuple[tuple[str, Mapping[str, Any]], ...]]:
    """Return how the robot is commanded, and the overrides of single logs."""
    inside = f"{joints.where}: control"
    table = table_of(values, "control", joints.where)
    fields = Fields(table, (), inside, ("command", "between_commands", "gain_of", "supply_V", *_LOOP))
    between = fields.one_of("between_commands", BETWEEN) if "between_commands" in fields else BETWEEN[0]
    control = Control(
        **{key: joints.read(table, key, inside) for key in _LOOP},
        held=between == BETWEEN[0],
        command=fields.one_of("command", get_args(Command)) if "command" in fields else "none",
        gain_of=fields.one_of("gain_of", get_args(GainOf)) if "gain_of" in fields else "torque",
        supply_V=fields.number("supply_V", above=0.0) if "supply_V" in fields else None,
    )
    logs = values.get("log", [])
    if not isinstance(logs, list) or not all(isinstance(log, dict) for log in logs):
        raise InputError(f"{joints.where}: log is {logs!r:.40}; it must be tables, [[log]]")
    alike = replace(joints, own={})
    found = []
    for number, log in enumerate(logs, 1):
        where = f"{joints.where}: log {number}"
        fields = Fields(log, ("match",), where, _OF_LOG)
        differs: dict[str, Any] = {key: alike.read(log, key, where) for key in _GAIN if key in log}
        if "supply_V" in fields:
            differs["supply_V"] = fields.number("supply_V", above=0.0)
        if not differs:
            raise InputError(f"{where}: says nothing; give it one of {', '.join(_OF_LOG[1:])}")
        found.append((fields.text("match"), differs))
    return control, tuple(found)
