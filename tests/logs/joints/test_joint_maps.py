"""Maps of joint logs that are not allowed, and damaged maps and logs: one sentence each."""

from __future__ import annotations

import random
from pathlib import Path

import numpy as np
import pytest

from estimator.errors import InputError
from joint_logs import JOINTS, MAP, SLIDES, columns, parsed, read, write_csv, write_table
from mocobot_logs.joints.joint_map import read_joint_map
from mocobot_logs.joints.read import open_joint_log, read_joint_log

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


FUZZ_TIME = np.arange(400) / 250.0
FULL = (
    MAP
    + """
[joint.hip]
gear = 3
zero = 0.1
[drive]
torque_constant = 0.1
coupling.knee = { hip = 2 }
[control]
command = "none"
supply_V = 24
[[log]]
match = "*.csv"
position_gain = [1, 2, 3]
"""
)
WORDS = (
    "-1", "0", "1e400", "nan", "inf", '""', '"x"', "[]", "[1, 2, 3]", "{}", "true", "false", '"free"',
    "99999999999999999999",
    '"{joint}"', '"{"', '"{}"', '"[0]"', "[[1]]", '"hip"', "1.5", '"deg"', '"counts"',
    "-0.0", '"\\u0000"', "2020-01-01",
)  # fmt: skip
CELLS = ("", "nan", "inf", "-1e308", "1e309", "x", '"', "1;2", "1,2", "\0", "0x10", "  3", "-", "1e5", "٣")


def mutated_map(rng: random.Random) -> str:
    """A map with some of its values, keys or lines changed."""
    lines = FULL.strip().splitlines()
    for _ in range(rng.choice((1, 1, 2, 4))):
        k = rng.randrange(len(lines))
        what = rng.randrange(6)
        if what == 0:
            del lines[k]
        elif what == 1:
            lines.insert(k, lines[rng.randrange(len(lines))])
        elif what == 2 and "=" in lines[k]:
            lines[k] = lines[k].partition("=")[0] + "= " + rng.choice(WORDS)
        elif what == 3 and "=" in lines[k]:
            key, _, value = lines[k].partition("=")
            lines[k] = key.strip()[:-1] + " =" + value
        elif what == 4 and lines[k]:
            at = rng.randrange(len(lines[k]))
            lines[k] = lines[k][:at] + chr(rng.randrange(32, 0x250)) + lines[k][at + 1 :]
        else:
            lines[k] = lines[k].replace("hip", rng.choice(("knee", "", "h\u00ef p", "lift")))
        if not lines:
            lines = [""]
    return "\n".join(lines) + "\n"


def mutated_bytes(content: bytes, rng: random.Random) -> bytes:
    """A file with some of its bytes changed, cut out, repeated or cut off."""
    data = bytearray(content)
    for _ in range(rng.choice((1, 2, 8))):
        at = rng.randrange(max(len(data), 1))
        what = rng.randrange(4)
        if what == 0 and data:
            data[at] = rng.randrange(256)
        elif what == 1:
            del data[at : at + rng.choice((1, 16, 500))]
        elif what == 2:
            data[at:at] = data[at : at + rng.choice((1, 16, 500))]
        elif rng.random() < 0.3:
            del data[at:]
    return bytes(data)


def outcome(log: Path, map_file: Path) -> str | None:
    """What is said, None if the log is read; anything but a sentence goes through."""
    try:
        log_map = read_joint_map(map_file, JOINTS, SLIDES)
        parts = read_joint_log(open_joint_log(log, log_map), log_map)
    except InputError as error:
        said = str(error)
        assert said.isprintable(), said
        assert len(said) < 1000, said
        assert said.startswith((f"map {map_file}", str(log))), said
        return said
    assert all(np.isfinite(part.q).all() for part in parts)
    return None


def test_damaged_maps(tmp_path) -> None:
    log = write_csv(tmp_path / "log.csv", columns(FUZZ_TIME))
    map_file = tmp_path / "log.toml"
    map_file.write_text(FULL, encoding="utf-8")
    assert outcome(log, map_file) is None
    said = []
    for seed in range(300):
        map_file.write_text(mutated_map(random.Random(seed)), encoding="utf-8")
        said.append(outcome(log, map_file))
    assert sum(each is None for each in said) > 15
    assert sum(each is not None for each in said) > 150
    assert len(set(said)) > 80


@pytest.mark.parametrize("suffix", [".csv", ".npz", ".parquet"])
def test_damaged_logs(tmp_path, suffix) -> None:
    log = write_table(tmp_path / f"log{suffix}", columns(FUZZ_TIME))
    map_file = tmp_path / "log.toml"
    map_file.write_text(FULL, encoding="utf-8")
    content = log.read_bytes()
    assert outcome(log, map_file) is None
    said = []
    for seed in range(100):
        log.write_bytes(mutated_bytes(content, random.Random(seed)))
        said.append(outcome(log, map_file))
    assert sum(each is not None for each in said) > 10


def test_odd_cells(tmp_path) -> None:
    map_file = tmp_path / "log.toml"
    map_file.write_text(FULL, encoding="utf-8")
    log = write_csv(tmp_path / "log.csv", columns(FUZZ_TIME))
    lines = log.read_text().splitlines()
    said = []
    for seed in range(120):
        rng = random.Random(seed)
        rows = list(lines)
        for _ in range(rng.choice((1, 3, 60))):
            k = rng.randrange(1, len(rows))
            cells = rows[k].split(",")
            cells[rng.randrange(len(cells))] = rng.choice(CELLS)
            rows[k] = ",".join(cells)
        log.write_text("\n".join(rows) + "\n", encoding="utf-8")
        said.append(outcome(log, map_file))
    assert sum(each is None for each in said) > 10
    assert sum(each is not None for each in said) > 50
