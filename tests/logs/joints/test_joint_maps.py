"""Maps of joint logs that are not allowed: one sentence each, with the key, the value and what is allowed."""

from __future__ import annotations

import numpy as np
import pytest

from estimator.errors import InputError
from joint_logs import JOINTS, MAP, columns, parsed, read, write_csv

TIME = np.arange(600) / 500.0


def refusal(text: str, joints: tuple[str, ...] = JOINTS) -> str:
    with pytest.raises(InputError) as refused:
        parsed(text, joints)
    said = str(refused.value)
    assert said.startswith("map my.toml: ")
    assert said.isprintable()
    return said.removeprefix("map my.toml: ")


REFUSED = {
    "version": (lambda t: "version = 7\n" + t, "version is 7; this program reads version 1"),
    "no joints": (lambda t: t.replace('joints = ["hip", "knee", "lift"]', ""), "missing key 'joints'"),
    "joint twice": (lambda t: t.replace('"knee", "lift"]', '"hip", "lift"]'), "joints is ['hip', 'hip', 'lift']"),
    "unknown joint": (
        lambda t: t.replace('"lift"]', '"lifd"]'), "joints: unknown joint 'lifd' (did you mean 'lift'?)"
    ),
    "joint left out": (lambda t: t.replace(', "lift"]', "]"), "joints lacks 'lift'; a map names every joint"),
    "unknown key": (lambda t: "drives = 1\n" + t, "unknown key 'drives' (did you mean 'drive'?)"),
    "unknown quantity": (
        lambda t: t.replace("[channels.dq]", "[channels.qd]"), "channels: unknown channel 'qd' (did you mean 'q'?)"
    ),
    "unknown entry": (
        lambda t: t.replace('unit = "deg"', 'unit = "deg"\nsigns = -1'),
        "channels.q: unknown key 'signs' (did you mean 'sign'?)",
    ),
    "no unit": (lambda t: t.replace('unit = "deg"', ""), "channels.q: missing key 'unit'; it is one of rad, deg"),
    "wrong unit": (
        lambda t: t.replace('unit = "deg"', 'unit = "Nm"'),
        "channels.q: unit is 'Nm'; positions of a turning joint come in rad, deg, turn, counts",
    ),
    "unit of a slide": (
        lambda t: t.replace('q.unit = "mm"', 'q.unit = "deg"'),
        "joint.lift.channels.q: unit is 'deg'; positions of a sliding joint come in m, mm, um, counts",
    ),
    "counts without turns": (
        lambda t: t.replace('unit = "deg"', 'unit = "counts"'), "channels.q: missing key 'counts_per_turn'"
    ),
    "turns without counts": (
        lambda t: t.replace('unit = "deg"', 'unit = "deg"\ncounts_per_turn = 4096'),
        "channels.q: counts_per_turn does not go with positions of a turning joint in 'deg'; leave it out",
    ),
    "sign": (lambda t: t.replace('unit = "deg"', 'unit = "deg"\nsign = 0'), "channels.q: sign is 0; it must be 1"),
    "bits": (
        lambda t: t.replace('unit = "deg"', 'unit = "deg"\nbits = 1'),
        "channels.q: bits is 1; it must be a whole number from 2 to 53",
    ),
    "placeholder": (
        lambda t: t.replace("{joint}.pos", "{robot}.pos"),
        "channels.q: column holds the placeholder '{robot}'; the placeholders are {joint}, {number}, {index}",
    ),
    "no place": (lambda t: t.replace('column = "{joint}.pos"', ""), "channels.q: missing key 'column'"),
    "joint without position": (
        lambda t: t.replace('[joint.lift.channels]\nq.unit = "mm"', "[joint.lift.channels]\nq = false"),
        "joint lift has no position; it needs a channel q or motor_position",
    ),
    "two torques": (
        lambda t: t + '[channels.current]\ncolumn = "i{number}"\nunit = "A"\n',
        "joint hip has torque and current; one torque of a joint is used, so leave out the others",
    ),
    "gear of none": (lambda t: t + "[drive]\ngear = [1, 0, 2]\n", "drive: gear is 0; it must be a number of motor"),
    "too few gears": (lambda t: t + "[drive]\ngear = [1, 2]\n", "drive: gear has 2 entries; it must have 3"),
    "gear and matrix": (
        lambda t: t + "[drive]\ngear = 2\ncoupling = [[1,0,0],[0,1,0],[0,0,1]]\n",
        "drive: coupling is a matrix, which has the gears in it; leave out gear",
    ),
    "matrix of another size": (
        lambda t: t + "[drive]\ncoupling = [[1,0],[0,1]]\n", "drive: coupling is [[1, 0], [0, 1]]; it must be 3 x 3"
    ),
    "singular": (
        lambda t: t + "[drive]\ncoupling = [[1,0,0],[1,0,0],[0,0,1]]\n",
        "drive: coupling is singular; where the motors are must tell where the joints are",
    ),
    "coupled with itself": (
        lambda t: t + "[drive]\ncoupling.hip = { hip = 2 }\n", "drive: coupling.hip: unknown joint 'hip'"
    ),
    "coupled by a word": (
        lambda t: t + '[drive]\ncoupling.hip = { knee = "1" }\n', "drive: coupling.hip: knee is '1'; it must be"
    ),
    "torque constant": (
        lambda t: t + "[drive]\ntorque_constant = -0.1\n",
        'drive: torque_constant is -0.1; it must be a positive number of newton metres per ampere, or "free"',
    ),
    "gain": (
        lambda t: t + "[joint.hip]\nposition_gain = 0\n", "joint.hip: position_gain is 0; it must be a positive number"
    ),
    "key of a joint": (
        lambda t: t + "[joint.hip]\ngears = 2\n", "joint.hip: unknown key 'gears' (did you mean 'gear'?)"
    ),
    "joint that is none": (lambda t: t + "[joint.hop]\ngear = 2\n", "joint: unknown joint 'hop' (did you mean 'hip'?)"),
    "command without a kind": (
        lambda t: t + 'command.unit = "m"\n[channels.command]\ncolumn = "c{number}"\nunit = "rad"\n',
        "control: missing key 'command', which says what the channel command is",
    ),
    "kind without a command": (
        lambda t: t + '[control]\ncommand = "position"\n',
        "control: command is 'position', but there is no channel command or motor_command",
    ),
    "unknown kind": (lambda t: t + '[control]\ncommand = "pose"\n', "control: command is 'pose'; it must be one of"),
    "log that says nothing": (lambda t: t + '[[log]]\nmatch = "a*"\n', "log 1: says nothing; give it one of"),
    "log without a pattern": (lambda t: t + "[[log]]\nsupply_V = 7\n", "log 1: missing key 'match'"),
    "log of a wrong kind": (lambda t: "log = 3\n" + t, "log is 3; it must be tables, [[log]]"),
    "volts of what": (
        lambda t: t.replace('unit = "Nm"', 'unit = "V"'),
        "channels.torque: missing key 'rated', which goes with unit 'V'",
    ),
    "rate": (lambda t: t.replace('unit = "s"', 'unit = "s"\nrate_hz = 5'), "time: rate_hz is 5; it must be"),
    "fast rate": (lambda t: t.replace('unit = "s"', 'unit = "s"\nrate_hz = 1e6'), "time: rate_hz is 1e+06; it must be"),
    "unit of time": (lambda t: t.replace('unit = "s"', 'unit = "h"'), "time: unit is 'h'; it must be one of"),
    "no torque": (
        lambda t: t[: t.index("[channels.torque]")] + '[joint.lift.channels]\nq.unit = "mm"\ndq.unit = "m/s"\n',
        "no joint has a torque, a current, a command or a duty",
    ),
    "shared by a joint": (
        lambda t: t + 'supply = { column = "v", unit = "V" }\n',
        "joint.lift.channels: supply is one column of the whole robot; put it in [channels]",
    ),
    "voltage without supply": (
        lambda t: t + 'motor_voltage = { column = "v", unit = "V" }\n', "channels: motor_voltage needs the supply"
    ),
    "table expected": (lambda t: "drive = 3\n" + t, "drive is 3; it must be a table, [drive]"),
}  # fmt: skip


@pytest.mark.parametrize("case", list(REFUSED))
def test_what_a_map_may_not_say(case) -> None:
    change, said = REFUSED[case]
    assert change(MAP) != MAP
    assert refusal(change(MAP)).startswith(said)


def test_free_constants_of_coupled_drives(tmp_path) -> None:
    text = MAP.replace("torque]", "current]").replace('"Nm"', '"A"').replace('torque.unit = "N"', "")
    text += '[drive]\ntorque_constant = "free"\ncoupling.knee = { hip = 1 }\n'
    with pytest.raises(InputError, match="torque_constant is 'free' for coupled drives"):
        read(write_csv(tmp_path / "log.csv", columns(TIME)), text)


def test_torques_of_half_a_coupled_drive(tmp_path) -> None:
    text = MAP.replace("channels.torque]", "channels.motor_torque]").replace(
        "torque.unit", "motor_torque.unit"
    )
    text += "[drive]\ncoupling.knee = { hip = 1 }\n[joint.knee.channels]\nmotor_torque = false\n"
    with pytest.raises(
        InputError, match="drive: coupling: the drive of joint 1 is coupled with one that has no"
    ):
        read(write_csv(tmp_path / "log.csv", columns(TIME)), text)


def test_a_supply_that_is_none(tmp_path) -> None:
    text = MAP.replace("[channels.q]", '[channels.supply]\ncolumn = "v"\nunit = "V"\n[channels.q]')
    path = write_csv(tmp_path / "log.csv", columns(TIME) | {"v": np.where(TIME > 1, 0.0, 7.0)})
    with pytest.raises(InputError, match="supply is 0 V in sample 501; it must be positive"):
        read(path, text)


def test_a_column_for_two_channels(tmp_path) -> None:
    text = MAP.replace("{joint}.tau", "{joint}.vel")
    with pytest.raises(InputError, match=r"dq of hip and torque of hip are the same column 'hip\.vel'"):
        read(write_csv(tmp_path / "log.csv", columns(TIME)), text)
