"""From the TOML of a joint log's map to a ``JointMap``: every key known, every value allowed, nothing missing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from estimator.errors import InputError
from estimator.strict import Fields, check_known
from mocobot_logs.joints.channels import Channels, channels_of
from mocobot_logs.joints.drives import OF_JOINT, Joints, control_of, gears_of
from mocobot_logs.joints.joint_map import Control, JointMap
from mocobot_logs.joints.quantities import COMMANDS, DUTIES, EFFORTS, POSITIONS, QUANTITIES
from mocobot_logs.map.files import toml_values
from mocobot_logs.map.parse import csv_map, table_of, time_map

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
