"""Text tables as robots and tools write them: no header, a stamp in two columns, wrapped positions, names of makers."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import numpy as np
import pytest

from command import refused, run
from estimator.errors import InputError
from joint_logs import write_csv
from made_arm import JOINTS, made, write_map, write_model
from mocobot import serial
from mocobot_logs.draft_joints import draft_joint_map
from mocobot_logs.presets import column_meaning

EPOCH_S = 1_700_000_000
Values = dict[str, np.ndarray]


@pytest.fixture(scope="module")
def values() -> Values:
    return made(seconds=4.0)


def numbers(values: Values, what: str) -> np.ndarray:
    return np.column_stack([values[f"{joint} {what}"] for joint in JOINTS])


def stamps(values: Values) -> tuple[np.ndarray, np.ndarray]:
    nanoseconds = np.rint(1e9 * values["time"]).astype(np.int64)
    return EPOCH_S + nanoseconds // 1_000_000_000, nanoseconds % 1_000_000_000


def inspected(capsys: pytest.CaptureFixture[str], folder: Path, log: Path) -> str:
    """Draft the map, then inspect by it; the last line."""
    model = folder / "arm.xml"
    code, _, err = run(capsys, "map", log, "--model", model, "--out", folder / "log.toml", "--force")
    assert code == 0
    assert "not complete" not in err
    return run(capsys, "inspect", log, "--model", model)[1].splitlines()[-1]


READY = "ready for: a diagnosis from torques of 3 joints"


@pytest.mark.parametrize(
    "names",
    [("header.stamp.sec", "header.stamp.nanosec"), ("stamp_secs", "stamp_nsecs"), ("sec", "nanosec")],
)
def test_a_stamp_in_two_columns(tmp_path, capsys, values, names) -> None:
    """Whole seconds and the nanoseconds after them are one time."""
    write_model(tmp_path)
    columns = dict(zip(names, stamps(values), strict=True))
    columns |= {f"{what}_{joint}": values[f"{joint} {what}"] for what in ("q", "torque") for joint in JOINTS}
    log = write_csv(tmp_path / "log.csv", columns)
    assert inspected(capsys, tmp_path, log) == READY
    text = (tmp_path / "log.toml").read_text()
    assert f'column = "{names[0]}"\nnanosec = "{names[1]}"\nunit = "s"\n' in text
    (read,) = serial.read_logs(log, tmp_path / "arm.xml")
    assert (read.rate_hz, len(read.time)) == (250.0, len(values["time"]))
    np.testing.assert_array_equal(read.q, numbers(values, "q"))


def test_nanoseconds_that_are_none(tmp_path, values) -> None:
    write_model(tmp_path)
    seconds, below = stamps(values)
    columns = {"s": seconds, "n": below} | {k: x for k, x in values.items() if k != "time"}
    text = """
joints = ["turret", "shoulder", "elbow"]
time = { column = "s", nanosec = "n", unit = "s" }
channels.q = { column = "{joint} q", unit = "rad" }
channels.torque = { column = "{joint} torque", unit = "Nm" }
"""
    write_map(tmp_path, text)
    log = write_csv(tmp_path / "log.csv", columns | {"n": np.where(below == below[7], 1_000_000_007, below)})
    with pytest.raises(
        InputError, match="column 'n' is 1000000007 in row 7; the nanoseconds of a stamp are 0 to"
    ):
        serial.read_logs(log, tmp_path / "arm.xml")
    for wrong in ('unit = "ms"', 'unit = "iso"'):
        write_map(tmp_path, text.replace('unit = "s"', wrong, 1))
        with pytest.raises(InputError, match="time: nanosec goes with a column of whole seconds"):
            serial.read_logs(log, tmp_path / "arm.xml")


def echo(folder: Path, values: Values, what: tuple[str, ...]) -> Path:
    """Rows of `ros2 topic echo --csv`: every field of every message, and no names."""
    seconds, below = stamps(values)
    numbers_of = np.hstack([numbers(values, each) for each in what])
    rows = [
        ",".join([str(s), str(ns), "", *JOINTS, *map(repr, row)])
        for s, ns, row in zip(seconds, below, numbers_of.tolist(), strict=True)
    ]
    path = folder / "echo.csv"
    path.write_text("\n".join(rows) + "\n")
    return path


def test_the_advice_for_an_echo_without_names_is_right(tmp_path, capsys, values) -> None:
    write_model(tmp_path)
    log = echo(tmp_path, values, ("q", "dq", "torque"))
    for command in ("map", "inspect"):
        message = refused(
            capsys,
            command,
            log,
            "--model",
            tmp_path / "arm.xml",
            *([] if command == "map" else ["--map", write_map(tmp_path)]),
        )
        assert f"{log}: the first line holds values, not names ('1700000000,0,,turret," in message
        assert "names the 15 columns" in message
    advised = message.partition("ros2 topic echo --csv`: ")[2]
    subprocess.run(advised, shell=True, check=True)
    assert inspected(capsys, tmp_path, log) == READY
    (read,) = serial.read_logs(log, tmp_path / "arm.xml")
    for got, what in ((read.q, "q"), (read.dq, "dq"), (read.torque, "torque")):
        np.testing.assert_array_equal(got, numbers(values, what))
    assert (read.rate_hz, len(read.time)) == (250.0, len(values["time"]))


def test_an_echo_whose_arrays_are_not_certain(tmp_path, capsys, values) -> None:
    """Two arrays: efforts or velocities? No names are proposed."""
    write_model(tmp_path)
    message = refused(capsys, "map", echo(tmp_path, values, ("q", "torque")), "--model", tmp_path / "arm.xml")
    assert message.endswith("write a line before it that names the 12 columns")


@pytest.mark.parametrize("header", ["time,0,1\n", "time,q 1,q 2\n", "x,1e3,y\n"])
def test_numbers_may_be_names(tmp_path, header) -> None:
    """A word that the next line does not repeat is a name."""
    path = tmp_path / "log.csv"
    path.write_text(header + "0.1,2.0,3.0\n0.2,2.0,3.0\n")
    assert draft_joint_map(path, JOINTS, [False] * 3).missing


@pytest.mark.parametrize("lowest", [-np.pi, 0.0], ids=["-pi to pi", "0 to 2 pi"])
@pytest.mark.parametrize("unit", ["rad", "deg"])
def test_positions_that_start_again_after_a_turn(tmp_path, capsys, values, lowest, unit) -> None:
    """The turret swings about half a turn: its encoder jumps there."""
    write_model(tmp_path)
    size = 1.0 if unit == "rad" else np.degrees(1.0)
    columns = {"time": values["time"]}
    turned = numbers(values, "q") + np.array([lowest + 2 * np.pi - values["turret q"].mean(), 0.0, 0.0])
    told = np.column_stack([np.mod(turned[:, 0] - lowest, 2 * np.pi) + lowest, turned[:, 1:]])
    for j, joint in enumerate(JOINTS):
        columns |= {f"q_{joint}_{unit}": size * told[:, j], f"torque_{joint}_Nm": values[f"{joint} torque"]}
    log = write_csv(tmp_path / "log.csv", columns)
    jumps = int(np.sum(np.abs(np.diff(told[:, 0])) > 5.0))
    assert jumps > 2
    draft = draft_joint_map(log, JOINTS, [False] * 3)
    assert draft.doubtful == 0
    assert f'unit = "{unit}" }}  # ' in draft.text
    assert "told within one turn: full turns are taken out" in draft.text
    assert inspected(capsys, tmp_path, log).startswith("ready for: a diagnosis")
    (read,) = serial.read_logs(log, tmp_path / "arm.xml")
    assert read.notes == (
        f"q of turret is told within one turn; {jumps} times it jumps by a full turn, which is taken out.",
    )
    np.testing.assert_allclose(np.diff(read.q, axis=0), np.diff(turned, axis=0), atol=1e-12)


def test_a_joint_whose_column_is_empty(tmp_path, capsys, values) -> None:
    """It is left out of the draft, and a column that nobody has is not in it at all."""
    write_model(tmp_path)
    none = np.full(len(values["time"]), np.nan)
    columns = values | {"elbow torque": none} | {f"{joint} dq": none for joint in JOINTS}
    log = write_csv(tmp_path / "log.csv", columns)
    assert inspected(capsys, tmp_path, log) == "ready for: a diagnosis from torques of 2 joints"
    text = (tmp_path / "log.toml").read_text()
    assert '[joint."elbow".channels]\ntorque = false' in text
    assert "# no dq: turret dq has no value; shoulder dq has no value; elbow dq has no value" in text
    assert serial.read_logs(log, tmp_path / "arm.xml")[0].notes == ()


def test_a_joint_that_no_column_names(tmp_path, capsys, values) -> None:
    """A gripper that nobody logged: the draft names it, and what it says to type makes the map complete."""
    text = write_model(tmp_path).read_text()
    hand = (
        '<body><joint name="grip" range="-1 1"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>'
    )
    (tmp_path / "arm.xml").write_text(
        text.replace(
            '<geom type="capsule" fromto="0 0 0 0 0 0.3"',
            f'{hand}<geom type="capsule" fromto="0 0 0 0 0 0.3"',
        )
    )
    log, out = write_csv(tmp_path / "log.csv", values), tmp_path / "log.toml"
    code, _, err = run(capsys, "map", log, "--model", tmp_path / "arm.xml", "--out", out)
    assert code == 0
    assert "the draft is not complete: joint grip must be filled in" in err
    drafted = out.read_text()
    assert "# doubtful: joint grip is in no column" in drafted
    assert 'q = { column = "{joint} q"' in drafted
    more = ("--model", tmp_path / "arm.xml", "--lock", "grip=0")
    _, _, err = run(capsys, "map", log, *more, "--out", out, "--force")
    assert "not complete" not in err
    assert run(capsys, "inspect", log, *more)[1].splitlines()[-1] == READY


def rtde(values: Values, per_ampere: np.ndarray, *more: str) -> Values:
    """Columns of a recording by UR's RTDE client, in its order."""
    time = values["time"]
    found = {"timestamp": time}
    for name, x in (
        ("target_q", numbers(values, "q")), ("target_qd", numbers(values, "dq")),
        ("target_current", numbers(values, "torque")), ("target_moment", numbers(values, "torque") + 5.0),
        *((each, numbers(values, "torque")) for each in more),
        ("joint_control_output", numbers(values, "torque")), ("joint_temperatures", 30.0 + numbers(values, "q")),
        ("actual_TCP_force", numbers(values, "q")), ("actual_q", numbers(values, "q")),
        ("actual_qd", numbers(values, "dq")), ("actual_current", numbers(values, "torque") / per_ampere),
    ):  # fmt: skip
        found |= {f"{name}_{j}": x[:, j] for j in range(3)}
    return found


def test_a_ur_tells_motor_currents(tmp_path, capsys, values) -> None:
    """What one ampere gives is unknown, known, or known of some joints; the target's moment is no measurement."""
    write_model(tmp_path)
    per_ampere = np.array([13.0, 12.0, 9.0])
    log = write_csv(tmp_path / "log.csv", rtde(values, per_ampere))
    inspected(capsys, tmp_path, log)
    text = (tmp_path / "log.toml").read_text()
    for line in (
        'command = { column = "target_q_{index}", unit = "rad" }',
        'q = { column = "actual_q_{index}", unit = "rad" }',
        'dq = { column = "actual_qd_{index}", unit = "rad/s" }',
        'current = { column = "actual_current_{index}", unit = "A" }',
        '[control]\ncommand = "position"\n',
        '[drive]\ntorque_constant = "free"',
    ):
        assert line in text
    assert "doubtful" not in text.split("\n", 2)[2]
    (read,) = serial.read_logs(log, tmp_path / "arm.xml")
    assert np.isnan(read.drive.torque_constant).all()
    for told, free in (('[13.0, "free", 9.0]', [False, True, False]), ("[13.0, 12.0, 9.0]", [False] * 3)):
        write_map(tmp_path, text.replace('torque_constant = "free"', f"torque_constant = {told}"))
        (read,) = serial.read_logs(log, tmp_path / "arm.xml")
        assert np.isnan(read.drive.torque_constant).tolist() == free
    np.testing.assert_allclose(read.torque, numbers(values, "torque"), rtol=1e-12)


def test_a_ur_may_tell_torques(tmp_path, capsys, values) -> None:
    """Controllers since PolyScope 5.23 can; one of torques and currents is used."""
    write_model(tmp_path)
    log = write_csv(tmp_path / "log.csv", rtde(values, np.ones(3), "actual_current_as_torque"))
    text = draft_joint_map(log, JOINTS, [False] * 3).text
    assert 'torque = { column = "actual_current_as_torque_{index}", unit = "Nm" }' in text
    assert '\n# or current = { column = "actual_current_{index}", unit = "A" }' in text
    assert "[drive]" not in text
    assert inspected(capsys, tmp_path, log).startswith(READY)


def test_a_frankas_torques_are_measured_behind_the_gear(tmp_path, values) -> None:
    write_model(tmp_path)
    q, torque = numbers(values, "q"), numbers(values, "torque")
    arrays = {"time": values["time"], "tau_ext_hat_filtered": 0 * q, "tau_J_d": 0 * q, "q_d": q, "dtau_J": q}
    arrays |= {"dq": numbers(values, "dq"), "q": q, "tau_J": torque, "ddq_d": q}
    path = tmp_path / "log.npz"
    np.savez(path, **arrays)  # type: ignore[arg-type]
    draft = draft_joint_map(path, JOINTS, [False] * 3)
    assert 'link_torque = { column = "tau_J[{index}]", unit = "Nm" }' in draft.text
    assert "gravity included" in draft.text
    write_map(tmp_path, draft.text)
    (read,) = serial.read_logs(path, tmp_path / "arm.xml")
    np.testing.assert_array_equal(read.torque, torque)
    np.testing.assert_array_equal(read.q, q)
    assert read.drive.link_side.all()


@pytest.mark.parametrize(
    ("name", "quantity"),
    [
        ("actual_q_{index}", "q"), ("rtde/actual_qd_{index}", "dq"), ("target_moment_{index}", None),
        ("actual_TCP_force_{index}", None), ("tool_acceleration", None), ("joint_temperatures_{index}", None),
        ("panda.tau_J[{index}]", "link_torque"), ("tau_J_d[{index}]", None),
        ("motor_state_{index}_q", "q"), ("motor_state_{index}_tau_est", "current"),
    ],
)  # fmt: skip
def test_names_of_makers(name: str, quantity: str | None) -> None:
    found = column_meaning(name)
    assert found is not None
    assert found.quantity == quantity


@pytest.mark.parametrize(
    "name", ["q_{number}", "{joint}.pos", "shoulder torque", "tau_{index}", "toolchanger_q"]
)
def test_names_of_nobody_in_particular(name: str) -> None:
    assert column_meaning(name) is None


@pytest.mark.parametrize(
    ("called", "unit"),
    [("posDeg{}", "deg"), ("velocityRpm{}", "rpm"), ("current_mA_{}", "mA"), ("{}_speed_rpm", "rpm")],
)
def test_units_within_names(tmp_path, called: str, unit: str) -> None:
    path = write_csv(
        tmp_path / "log.csv",
        {"time": np.arange(50) / 100} | {called.format(k): np.arange(50.0) * k for k in (1, 2, 3)},
    )
    (line,) = (s for s in draft_joint_map(path, JOINTS, [False] * 3).text.splitlines() if "{number}" in s)
    assert re.search(rf'unit = "{unit}" }}  # (?!doubtful)', line), line
