"""Joint states as drivers publish them: who sends which joints, what is empty, NaN or unstamped, and what is said."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

import bags
from bags import EPOCH_NS, Said, raw_mcap, said
from command import refused, run
from estimator.errors import InputError
from made_arm import JOINTS, made, write_map, write_model
from mocobot import serial
from mocobot_logs.draft_joints import draft_joint_map

TOPIC = "/joint_states"
MAP = """
joints = ["turret", "shoulder", "elbow"]
[defaults]
topic = "/joint_states"
joint = "{joint}"
[channels]
q = { field = "position", unit = "rad" }
dq = { field = "velocity", unit = "rad/s" }
torque = { field = "effort", unit = "Nm" }
"""


@pytest.fixture(scope="module")
def values() -> dict[str, np.ndarray]:
    return made(seconds=4.0)


def numbers(values: dict[str, np.ndarray], what: str) -> np.ndarray:
    return np.column_stack([values[f"{joint} {what}"] for joint in JOINTS])


def stamp(values: dict[str, np.ndarray], k: int) -> int:
    return EPOCH_NS + round(1e9 * values["time"][k])


Fields = dict[str, Any]
Change = Callable[[int, Fields], Fields]


def arm(values: dict[str, np.ndarray], change: Change = lambda _, state: state) -> list[Said]:
    """What a driver publishes; ``change`` takes the number of the message and its fields."""
    q, dq, torque = (numbers(values, what) for what in ("q", "dq", "torque"))
    found = []
    for k in range(len(q)):
        at = stamp(values, k)
        fields = {"position": q[k], "effort": torque[k], "velocity": dq[k], "names": JOINTS, "stamp_ns": at}
        found.append(said(TOPIC, at + 1000, bags.joint_state(**change(k, fields))))
    return found


def part(fields: Fields, joints: slice | list[int]) -> Fields:
    cut = {key: np.asarray(fields[key])[joints] for key in ("position", "effort", "velocity")}
    return fields | cut | {"names": [str(name) for name in np.asarray(JOINTS)[joints]]}


def write(folder: Path, messages: list[Said], text: str = MAP) -> Path:
    write_model(folder)
    write_map(folder, text)
    return raw_mcap(folder / "log.mcap", sorted(messages, key=lambda each: each.log_ns))


def drafted(path: Path) -> tuple[str, tuple[str, ...]]:
    found = draft_joint_map(path, JOINTS, [False] * 3)
    return found.text, found.missing


def assert_arm(log: serial.JointLog, values: dict[str, np.ndarray], rows: slice = slice(None)) -> None:
    np.testing.assert_array_equal(log.q, numbers(values, "q")[rows])
    assert log.torque is not None
    np.testing.assert_array_equal(log.torque, numbers(values, "torque")[rows])
    assert log.rate_hz == 250.0


def gripper(values: dict[str, np.ndarray]) -> list[Said]:
    """Every fourth sample, between those of the arm, and nothing of the arm."""
    found = []
    for k in range(0, len(values["time"]), 4):
        at = stamp(values, k) + 1_700_000
        found.append(said(TOPIC, at + 1000, bags.joint_state([0.02], [], at, names=["finger"])))
    return found


def test_a_gripper_on_the_same_topic_is_no_sample_of_the_arm(tmp_path, capsys, values) -> None:
    path = write(tmp_path, [*arm(values), *gripper(values)])
    (log,) = serial.read_logs(path, tmp_path / "arm.xml")
    assert_arm(log, values)
    assert log.notes == (f"250 of 1250 messages of topic {TOPIC} hold other joints alone.",)
    code, out, _ = run(capsys, "inspect", path, "--model", tmp_path / "arm.xml", "--strict")
    assert (code, out.splitlines()[-1]) == (0, "ready for: a diagnosis from torques of 3 joints")
    text, missing = drafted(path)
    assert missing == ()
    assert "false" not in text


def test_publishers_that_share_the_arm_come_onto_one_time(tmp_path, values) -> None:
    """The elbow's driver samples between the others; motion of 2 Hz at most is smooth at 250 Hz."""

    def elbow(k: int, fields: Fields) -> Fields:
        return part(fields, [2]) | {"stamp_ns": stamp(values, k) + 2_000_000}

    later = [replace(each, log_ns=each.log_ns + 2_000_000) for each in arm(values, elbow)]
    path = write(tmp_path, [*arm(values, lambda _, fields: part(fields, [0, 1])), *later])
    (log,) = serial.read_logs(path, tmp_path / "arm.xml")
    assert log.usable.all()
    q = numbers(values, "q")
    first = int(np.argmin(np.abs(q[:, 0] - log.q[0, 0])))
    rows = slice(first, first + len(log.q))
    assert len(log.q) >= 995
    np.testing.assert_array_equal(log.q[:, :2], q[rows, :2])
    elbow_q = values["elbow q"]
    between = 0.5 * (elbow_q[:-1] + elbow_q[1:])  # half a period before the rows; off by dq^2/8 and noise
    np.testing.assert_allclose(log.q[:, 2], np.append(np.nan, between)[rows], atol=2e-4)
    assert drafted(path)[1] == ()


def test_efforts_that_are_fewer_than_names(tmp_path, capsys, values) -> None:
    """JointState.msg: arrays are of one size or empty, else nobody knows whose numbers they are."""
    short = arm(values, lambda _, fields: fields | {"effort": fields["effort"][:2]})
    path = write(tmp_path, short)
    for command in ("inspect", "diagnose"):
        message = refused(capsys, command, path, "--model", tmp_path / "arm.xml")
        assert (
            "torque of turret, cannot be told from the others: effort holds 2 numbers for 3 names" in message
        )
    text, missing = drafted(path)
    assert "# no torque: effort holds 2 numbers for 3 names in the first 1000 messages" in text
    assert "torque = {" not in text
    assert missing == ("a torque, a current, a command or a duty",)


def test_empty_arrays(tmp_path, capsys, values) -> None:
    path = write(tmp_path, arm(values, lambda _, fields: fields | {"effort": [], "velocity": []}))
    text, missing = drafted(path)
    assert "# no dq: velocity is empty in the first 1000 messages" in text
    assert "# no torque: effort is empty in the first 1000 messages" in text
    assert missing == ("a torque, a current, a command or a duty",)
    message = refused(capsys, "diagnose", path, "--model", tmp_path / "arm.xml")
    assert (
        "has no value in any row for dq of turret, shoulder, elbow; torque of turret, shoulder, elbow"
        in message
    )
    assert "nothing to compare the model with" in message


def test_one_joint_without_effort(tmp_path, values) -> None:
    """The draft leaves that joint out; so does reading by a map that names it."""

    def without(_: int, fields: Fields) -> Fields:
        return fields | {"effort": np.where(np.arange(3) == 1, np.nan, fields["effort"])}

    path = write(tmp_path, arm(values, without))
    text, missing = drafted(path)
    assert missing == ()
    assert '[joint."shoulder".channels]\ntorque = false  # effort is NaN in the first 1000 messages' in text
    logs = serial.read_logs(path, tmp_path / "arm.xml")
    write_map(tmp_path, text)
    logs += serial.read_logs(path, tmp_path / "arm.xml")
    for log in logs:
        assert log.torque is not None
        assert np.isnan(log.torque).all(axis=0).tolist() == [False, True, False]
    assert logs[0].notes == ("No row has a value of torque of shoulder; it is left out.",)


def test_bytes_after_the_last_field_are_left_unread(tmp_path, values) -> None:
    path = write(tmp_path, [replace(each, data=each.data + b"\1" * 8) for each in arm(values)])
    (log,) = serial.read_logs(path, tmp_path / "arm.xml")
    assert_arm(log, values)
    assert log.notes == (
        f"Messages of topic {TOPIC} have up to 8 bytes after their last field, which are not read.",
    )
    assert drafted(path)[1] == ()


def test_some_header_stamps_are_zero(tmp_path, capsys, values) -> None:
    """The driver had no clock yet."""
    path = write(tmp_path, arm(values, lambda k, fields: fields | ({"stamp_ns": 0} if k < 3 else {})))
    (log,) = serial.read_logs(path, tmp_path / "arm.xml")
    assert_arm(log, values, slice(3, None))
    assert log.notes == (f"3 header stamps of topic {TOPIC} are zero; these messages are left out.",)
    code, out, _ = run(capsys, "inspect", path, "--model", tmp_path / "arm.xml", "--strict")
    assert (code, out.splitlines()[-1]) == (0, "ready for: a diagnosis from torques of 3 joints")


def test_all_header_stamps_are_zero(tmp_path, values) -> None:
    path = write(tmp_path, arm(values, lambda _, fields: fields | {"stamp_ns": 0}))
    (log,) = serial.read_logs(path, tmp_path / "arm.xml")
    assert_arm(log, values)
    said_so = f"The header stamps of topic {TOPIC} are zero, so the recorder's time is taken."
    assert log.notes == (said_so,)
    text, _ = drafted(path)
    assert 'clock = "log"' in text
    write_map(tmp_path, text)
    assert serial.read_logs(path, tmp_path / "arm.xml")[0].notes == ()


def test_joints_on_several_topics_and_on_none(tmp_path, values) -> None:
    """The draft names each joint's topic; a joint that is nowhere is missing."""
    hand = [replace(each, topic="/hand") for each in arm(values, lambda _, fields: part(fields, [2]))]
    path = write(tmp_path, [*arm(values, lambda _, fields: part(fields, [0, 1])), *hand])
    text, missing = drafted(path)
    assert missing == ()
    write_map(tmp_path, text)
    (log,) = serial.read_logs(path, tmp_path / "arm.xml")
    assert_arm(log, values)
    raw_mcap(path, arm(values, lambda _, fields: part(fields, [0, 1])))
    text, missing = drafted(path)
    assert missing == ("joint elbow",)
    assert "# doubtful: joint elbow is in no message" in text
    with pytest.raises(
        InputError, match=r"joint 'elbow', wanted for q of elbow, is missing in every message"
    ):
        serial.read_logs(path, tmp_path / "arm.xml", map=write_map(tmp_path, MAP))


# Robots whose messages mean something else.

LOW_STATE = "unitree_go/MotorState[20] motor_state\nuint32 tick\n"
MOTOR_STATE = "uint8 mode\nfloat32 q\nfloat32 dq\nfloat32 ddq\nfloat32 tau_est\n"


def test_unitree_tells_torques_of_unknown_scale(tmp_path, values) -> None:
    types = get_typestore(Stores.ROS2_HUMBLE)
    types.register(get_types_from_msg(MOTOR_STATE, "unitree_go/msg/MotorState"))
    types.register(get_types_from_msg(LOW_STATE, "unitree_go/msg/LowState"))
    kind, motor = "unitree_go/msg/LowState", types.types["unitree_go/msg/MotorState"]
    q, dq, torque = (numbers(values, what) for what in ("q", "dq", "torque"))
    messages = []
    for k in range(len(q)):
        states = [
            motor(1, *(float(x[k, j]) if j < 3 else 0.0 for x in (q, dq, 0 * q, 0.7 * torque)))
            for j in range(20)
        ]
        data = bytes(types.serialize_cdr(types.types[kind](states, k), kind))
        messages.append(Said("/lowstate", stamp(values, k), kind, data))
    write_model(tmp_path)
    text = f"{LOW_STATE}{'=' * 80}\nMSG: unitree_go/MotorState\n{MOTOR_STATE}"
    path = raw_mcap(tmp_path / "log.mcap", messages, definitions={kind: ("ros2msg", text)})
    text, missing = drafted(path)
    assert missing == ()
    assert "current = {" in text
    assert "unknown scale" in text
    assert "doubtful: messages number the joints; is this their order? 0 is turret, 1 is shoulder" in text
    write_map(tmp_path, text)
    (log,) = serial.read_logs(path, tmp_path / "arm.xml")
    assert np.isnan(log.drive.torque_constant).all()
    np.testing.assert_allclose(log.q, q, rtol=1e-6, atol=1e-6)
    assert log.torque is not None
    np.testing.assert_allclose(log.torque, 0.7 * torque, rtol=1e-6, atol=1e-5)


UR = (
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "elbow_joint",
    "wrist_1_joint",
    "wrist_2_joint",
    "wrist_3_joint",
)
FRANKA = tuple(f"fr3_joint{k}" for k in range(1, 8))


@pytest.mark.parametrize(
    ("joints", "line", "doubtful", "constant"),
    [
        (UR, 'current = { topic = "/t", joint = "{joint}", field = "effort", unit = "A" }', 1, True),
        (FRANKA, 'link_torque = { topic = "/t", joint = "{joint}", field = "effort", unit = "Nm" }', 0, False),
    ],
    ids=["UR", "Franka"],
)  # fmt: skip
def test_effort_is_what_the_robots_driver_says(tmp_path, joints, line, doubtful, constant) -> None:
    q, ones = np.sin(np.arange(len(joints))), np.ones(len(joints))
    times = (EPOCH_NS + 2_000_000 * k for k in range(100))
    states = [said("/t", at, bags.joint_state(q, ones, at, joints)) for at in times]
    draft = draft_joint_map(raw_mcap(tmp_path / "log.mcap", states), joints, [False] * len(joints))
    assert line in draft.text
    assert draft.doubtful == doubtful
    assert ('torque_constant = "free"' in draft.text) is constant
    assert draft.missing == ()
