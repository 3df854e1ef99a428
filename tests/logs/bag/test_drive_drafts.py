"""Drafts for robots that log commands and positions: what is drafted reads the log back exactly."""

from __future__ import annotations

import itertools
import json
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

import bags
import mocobot
from bags import EPOCH_NS, Said, raw_mcap
from joint_logs import write_csv
from mocobot import serial
from mocobot_logs.draft_joints import draft_joint_map

SEPARATOR = "=" * 80
SECONDS = 4.0


def model(folder: Path, joints: list[str] | tuple[str, ...]) -> Path:
    """A chain of hinges of these names."""
    bodies = "".join(
        f'<body pos="0 0 .1"><joint name="{joint}" axis="0 {k % 2} {1 - k % 2}"/><geom size=".05"/>'
        for k, joint in enumerate(joints)
    )
    text = (
        f'<mujoco><compiler angle="radian"/><worldbody>{bodies}{"</body>" * len(joints)}</worldbody></mujoco>'
    )
    path = folder / "robot.xml"
    path.write_text(text, encoding="utf-8")
    return path


def waves(time: np.ndarray, joints: int, late_s: float = 0.0) -> np.ndarray:
    """Positions of joints, each at frequencies of its own, shape (Q, J)."""
    k = np.arange(joints)
    t = time[:, None] - late_s
    return 0.4 * np.sin(2 * np.pi * (0.5 + 0.07 * k) * t + k) + 0.2 * np.sin(2 * np.pi * (1.7 + 0.05 * k) * t)


def drafted(path: Path, robot: Path) -> tuple[str, serial.JointLog]:
    """The draft, which is complete, and the log that it reads."""
    text = str(mocobot.map(path, robot))
    (path.parent / "draft.toml").write_text(text, encoding="utf-8")
    (log,) = serial.read_logs(path, robot, map=path.parent / "draft.toml")
    return text, log


def lag_ms(text: str) -> float:
    found = re.search(r"the position follows by (\d+) ms", text)
    assert found is not None, text
    return float(found[1])


# Unitree.

MOTOR = {
    "State": "uint8 mode\nfloat32 q\nfloat32 dq\nfloat32 ddq\nfloat32 tau_est\n",
    "Cmd": "uint8 mode\nfloat32 q\nfloat32 dq\nfloat32 tau\nfloat32 kp\nfloat32 kd\n",
}
LEGS = [f"{leg}_{name}_joint" for leg in ("FL", "FR", "RL", "RR") for name in ("hip", "thigh", "calf")]
"""Joints in the order of the model, which is not that of the motors."""
MOTORS = [f"{leg}_{name}_joint" for leg in ("FR", "FL", "RR", "RL") for name in ("hip", "thigh", "calf")]
LOW_STAMPS = SimpleNamespace(
    state=np.arange(int(500 * SECONDS)) / 500.0, cmd=np.arange(0.0113, SECONDS - 0.3, 0.02)
)
LOW_STAMPS.cmd = np.delete(
    LOW_STAMPS.cmd, slice(60, 68)
)  # a pause, longer than gaps that are bridged, and an early end


def unitree_bag(folder: Path, kp: np.ndarray, tau: float) -> tuple[Path, np.ndarray, np.ndarray]:
    """LowState at 500 Hz and LowCmd at 50 Hz; positions and commands by motor, shape (q, 12) and (m, 12)."""
    types = get_typestore(Stores.ROS2_HUMBLE)
    for name, text in MOTOR.items():
        types.register(get_types_from_msg(text, f"unitree_go/msg/Motor{name}"))
        types.register(get_types_from_msg(whole(name), f"unitree_go/msg/Low{name}"))
    q, told = np.zeros((len(LOW_STAMPS.state), 20)), np.zeros((len(LOW_STAMPS.cmd), 20))
    q[:, :12], told[:, :12] = (
        waves(LOW_STAMPS.state, 12, 0.03).astype(np.float32),
        waves(LOW_STAMPS.cmd, 12).astype(np.float32),
    )
    messages = []
    for name, stamps, rows in (("State", LOW_STAMPS.state, q), ("Cmd", LOW_STAMPS.cmd, told)):
        kind, motor = f"unitree_go/msg/Low{name}", types.types[f"unitree_go/msg/Motor{name}"]
        for k, (at, row) in enumerate(zip(stamps, rows, strict=True)):
            if name == "State":
                motors = [motor(1, x, 0.0, 0.0, 0.1 * x) for x in row]
            else:
                motors = [motor(1, x, 0.0, tau * k, kp[k % len(kp), j % 12], 1.5) for j, x in enumerate(row)]
            data = bytes(types.serialize_cdr(types.types[kind](motors, k), kind))
            messages.append(Said(f"/low{name.lower()}", EPOCH_NS + round(1e9 * at), kind, data))
    told_texts = {
        f"unitree_go/msg/Low{name}": (
            "ros2msg",
            f"{whole(name)}{SEPARATOR}\nMSG: unitree_go/Motor{name}\n{text}",
        )
        for name, text in MOTOR.items()
    }
    messages.sort(key=lambda each: each.log_ns)
    return raw_mcap(folder / "log.mcap", messages, definitions=told_texts), q[:, :12], told[:, :12]


def held(
    stamps: np.ndarray, values: np.ndarray, at: np.ndarray, period: float
) -> tuple[np.ndarray, np.ndarray]:
    """Means of what holds during a period, and which periods have one value alone, by the integral over time."""
    ends = np.append(stamps, at[-1] + 1.0)
    integral = np.concatenate(
        [np.zeros((1, values.shape[1])), np.cumsum(values * np.diff(ends)[:, None], axis=0)]
    )
    a, b = (np.column_stack([np.interp(t, ends, x) for x in integral.T]) for t in (at, at + period))
    first, last = (np.searchsorted(stamps, t, side="right") - 1 for t in (at + 1e-9, at + period - 1e-9))
    whole = first == last
    return np.where(whole[:, None], values[first], (b - a) / period), whole


def whole(name: str) -> str:
    return f"unitree_go/Motor{name}[20] motor_{name.lower()}\nuint32 tick\n"


def test_unitree_commands_hold_on_their_own_stamps(tmp_path) -> None:
    path, q, told = unitree_bag(tmp_path, np.full((1, 12), 20.0), 0.0)
    text, log = drafted(path, model(tmp_path, LEGS))
    assert f"joints = {json.dumps(MOTORS)}" in text
    assert 'gain_of = "torque"\nposition_gain = 20  # constant in the log\nvelocity_gain = 1.5' in text
    assert "# no feedforward: it is zero throughout" in text
    assert "doubtful" not in text.split("\n", 1)[1]
    order = [MOTORS.index(joint) for joint in LEGS]
    rows = LOW_STAMPS.state >= LOW_STAMPS.cmd[0]
    np.testing.assert_array_equal(log.q, q[rows][:, order])
    mean, whole = held(LOW_STAMPS.cmd, told[:, order], LOW_STAMPS.state[rows], 0.002)
    assert log.command is not None
    np.testing.assert_allclose(log.command, mean, rtol=0, atol=1e-6)  # stamps are whole nanoseconds
    np.testing.assert_array_equal(log.command[whole], mean[whole])
    assert log.usable.all()
    assert log.drive.held
    assert log.drive.gain_of == "torque"
    assert log.drive.position_gain.tolist() == [20.0] * 12
    assert log.drive.velocity_gain.tolist() == [1.5] * 12
    assert not log.drive.gain_free.any()
    assert log.drive.feedforward is None
    assert lag_ms(text) == pytest.approx(30.0, abs=1.5)


def test_unitree_gains_that_change_and_torques_that_are_added(tmp_path) -> None:
    """Half of the legs are in the model: the draft names their motors one by one."""
    kp = np.full((4, 12), 20.0)
    kp[0, 7] = 40.0
    joints = [joint for joint in LEGS if joint[0] == "R"]  # motors 6 to 11
    path, q, _ = unitree_bag(tmp_path, kp, 0.01)
    text, log = drafted(path, model(tmp_path, joints))
    assert "doubtful: position_gain of RR_thigh_joint is 20 to 40: the most frequent is here" in text
    motors = [MOTORS.index(joint) for joint in joints]
    rows = LOW_STAMPS.state >= LOW_STAMPS.cmd[0]
    np.testing.assert_array_equal(log.q, q[rows][:, motors])
    tau = np.float32(0.01 * np.arange(len(LOW_STAMPS.cmd)))[:, None].astype(float)
    assert log.drive.feedforward is not None
    mean, _ = held(LOW_STAMPS.cmd, tau, LOW_STAMPS.state[rows], 0.002)
    np.testing.assert_allclose(log.drive.feedforward[:, 2], mean[:, 0], rtol=0, atol=1e-6)


# Dynamixel.


def test_dynamixel_counts(tmp_path) -> None:
    time = np.arange(800) / 200.0
    present, goal = (2048 + np.rint(600 * waves(time, 2, late)) for late in (0.04, 0.0))
    pwm = np.rint(885 * 0.3 * waves(time, 2))
    columns = {"time_s": time}
    for j in range(2):
        columns |= {
            f"present_position_{j + 1}": present[:, j], f"goal_position_{j + 1}": goal[:, j],
            f"present_pwm_{j + 1}": pwm[:, j] % 65536, f"position_p_gain_{j + 1}": np.full(800, 400.0 * (j + 1)),
            f"present_velocity_{j + 1}": np.rint(10 * waves(time, 2)[:, j]),
        }  # fmt: skip
    path = write_csv(tmp_path / "log.csv", columns)
    text, log = drafted(path, model(tmp_path, ["pan", "tilt"]))
    np.testing.assert_allclose(log.q, (present - 2048) * 2 * np.pi / 4096, rtol=0, atol=1e-15)
    np.testing.assert_allclose(log.command, (goal - 2048) * 2 * np.pi / 4096, rtol=0, atol=1e-15)
    np.testing.assert_allclose(log.drive.duty, pwm / 885, rtol=0, atol=1e-15)
    assert log.dq is not None
    np.testing.assert_allclose(log.dq, np.rint(10 * waves(time, 2)) * 0.229 * np.pi / 30, rtol=0, atol=1e-15)
    assert log.drive.gain_of == "firmware"
    assert log.drive.position_gain.tolist() == [400.0, 800.0]
    np.testing.assert_allclose(log.position_step, 2 * np.pi / 4096)
    assert "doubtful: where is each joint, in the model, when its reading is 0? zero = [ ... ]" in text
    assert "sign = -1" in text
    assert lag_ms(text) == pytest.approx(40.0, abs=3.0)


# Feetech, as LeRobot logs them.

SO101 = ("shoulder_pan", "shoulder_lift", "gripper")
CALIBRATION = {
    "shoulder_pan": {"id": 1, "drive_mode": 0, "homing_offset": -1470, "range_min": 823, "range_max": 3215},
    "shoulder_lift": {"id": 2, "drive_mode": 1, "homing_offset": 997, "range_min": 700, "range_max": 3400},
    "gripper": {"id": 6, "drive_mode": 0, "homing_offset": 12, "range_min": 1990, "range_max": 3450},
}


def lerobot(folder: Path, normalised) -> tuple[Path, np.ndarray]:
    """A dataset with these units, by LeRobot's own formulas, and the counts from the middle of the range."""
    time = np.arange(900) / 30.0
    middle = np.array([0.5 * (one["range_min"] + one["range_max"]) for one in CALIBRATION.values()])
    counts = np.rint(middle + 500 * waves(time, 3, 0.08))
    goal = middle + 500 * waves(time, 3)
    told = [
        np.column_stack([normalised(name, x[:, j]) for j, name in enumerate(SO101)]).astype(np.float32)
        for x in (counts, goal)
    ]
    (folder / "data" / "chunk-000").mkdir(parents=True)
    (folder / "meta").mkdir()
    arrays = [pa.FixedSizeListArray.from_arrays(pa.array(x.ravel()), 3) for x in told]
    frame = np.arange(len(time))
    table = {
        "observation.state": arrays[0], "action": arrays[1], "timestamp": pa.array(np.float32(time)),
        "frame_index": frame, "episode_index": 0 * frame, "index": frame, "task_index": 0 * frame,
    }  # fmt: skip
    pq.write_table(pa.table(table), folder / "data" / "chunk-000" / "file-000.parquet")
    feature = {"dtype": "float32", "shape": [3], "names": [f"{name}.pos" for name in SO101]}
    info = {
        "codebase_version": "v3.0",
        "fps": 30,
        "features": {"observation.state": feature, "action": feature},
    }
    (folder / "meta" / "info.json").write_text(json.dumps(info))
    return folder, counts - middle


def in_range(name: str, counts: np.ndarray) -> np.ndarray:
    one = CALIBRATION[name]
    share = (counts - one["range_min"]) / (one["range_max"] - one["range_min"])
    if name == "gripper":
        return 100 * share
    return (share * 200 - 100) * (-1 if one["drive_mode"] else 1)


@pytest.mark.parametrize("beside", [True, False])
def test_feetech_in_shares_of_a_range(tmp_path, beside) -> None:
    """The step of the readings tells the range, too, where no calibration is beside."""
    folder, counts = lerobot(tmp_path / "set", in_range)
    if beside:
        (folder / "meta" / "my_arm.json").write_text(json.dumps(CALIBRATION))
    text, log = drafted(folder, model(tmp_path, SO101))
    angle = counts * 2 * np.pi / 4096
    span = CALIBRATION["gripper"]["range_max"] - CALIBRATION["gripper"]["range_min"]
    angle[:, 1] *= -1
    angle[:, 2] += 0.5 * span * 2 * np.pi / 4096
    np.testing.assert_allclose(log.q, angle, rtol=0, atol=2e-6)  # states are 32-bit floats
    np.testing.assert_allclose(log.position_step, 2 * np.pi / 4096, rtol=1e-4)
    assert log.drive.gain_free.all()
    assert log.drive.gain_of == "duty"
    assert ("by my_arm.json" in text) == beside
    assert ("drive_mode of shoulder_lift is 1" in text) == beside
    assert ("one step of the readings is taken for one count in 4096 a turn: is it?" in text) != beside
    assert "zero = [ ... ]" in text
    assert lag_ms(text) == pytest.approx(80.0, abs=3.0)


def test_feetech_in_degrees(tmp_path) -> None:
    def degrees(name: str, counts: np.ndarray) -> np.ndarray:
        one = CALIBRATION[name]
        return in_range(name, counts) if name == "gripper" else (
            counts - 0.5 * (one["range_min"] + one["range_max"])
        ) * 360 / 4095  # fmt: skip

    folder, counts = lerobot(tmp_path / "set", degrees)
    (folder / "my_arm.json").write_text(json.dumps(CALIBRATION))
    text, log = drafted(folder, model(tmp_path, SO101))
    np.testing.assert_allclose(log.q[:, :2], counts[:, :2] * 2 * np.pi / 4095, rtol=0, atol=2e-6)
    assert "unit of" not in text
    assert '[joint."gripper".channels]\nq = { unit = "%", rated = 2.239' in text


# ros2_control.

JTC = "control_msgs/msg/JointTrajectoryControllerState"
POINT = "trajectory_msgs/msg/JointTrajectoryPoint"


@pytest.mark.parametrize("words", [("reference", "feedback"), ("desired", "actual")])
def test_trajectory_controllers(tmp_path, words) -> None:
    text = f"std_msgs/Header header\nstring[] joint_names\ntrajectory_msgs/JointTrajectoryPoint {words[0]}\n"
    text += f"trajectory_msgs/JointTrajectoryPoint {words[1]}\n"
    types = get_typestore(Stores.ROS2_HUMBLE)
    types.register(get_types_from_msg(text, JTC))
    names = ["c", "a", "b"]
    time = np.arange(400) / 100.0
    told, q = waves(time, 3), waves(time, 3, 0.025)
    dq = np.gradient(q, time, axis=0)
    messages = []
    for k, at in enumerate(time):
        ns = EPOCH_NS + round(1e9 * at)
        none = np.empty(0)
        zero = types.types["builtin_interfaces/msg/Duration"](sec=0, nanosec=0)
        points = [types.types[POINT](x[k], v, none, none, zero) for x, v in ((told, none), (q, dq[k]))]
        data = bytes(types.serialize_cdr(types.types[JTC](bags.header(ns), names, *points), JTC))
        messages.append(Said("/arm_controller/controller_state", ns, JTC, data))
    texts = [text, *itertools.chain(*((f"MSG: {kind}", bags.definition(kind)) for kind in (POINT,)))]
    path = raw_mcap(tmp_path / "log.mcap", messages, definitions={JTC: ("ros2msg", joined(texts))})
    draft, log = drafted(path, model(tmp_path, ["a", "b", "c"]))
    order = [names.index(joint) for joint in "abc"]
    np.testing.assert_array_equal(log.q, q[:, order])
    np.testing.assert_array_equal(log.command, told[:, order])
    assert log.dq is not None
    np.testing.assert_array_equal(log.dq, dq[:, order])
    assert 'position_gain = "free"' in draft
    assert log.drive.gain_free.all()
    assert lag_ms(draft) == pytest.approx(25.0, abs=1.0)


def test_a_gripper_that_no_controller_moves(tmp_path) -> None:
    """Joint states name four joints, the controller three of them, at half the rate."""
    text = f"std_msgs/Header header\nstring[] joint_names\n{POINT.replace('/msg', '')} reference\n"
    text += f"{POINT.replace('/msg', '')} feedback\n"
    types = get_typestore(Stores.ROS2_HUMBLE)
    types.register(get_types_from_msg(text, JTC))
    names, joints = ["c", "a", "b"], ["a", "grip", "b", "c"]
    time = np.arange(600) / 100.0
    told, q = waves(time, 3), waves(time, 4, 0.025)
    messages, none = [], np.empty(0)
    zero = types.types["builtin_interfaces/msg/Duration"](sec=0, nanosec=0)
    for k, at in enumerate(time):
        ns = EPOCH_NS + round(1e9 * at)
        state = bags.joint_state(q[k], [], ns, names=joints)
        messages.append(bags.said("/joint_states", ns, state))
        if k % 2 == 0:
            points = [types.types[POINT](x, none, none, none, zero) for x in (told[k], q[k, [3, 0, 2]])]
            data = bytes(types.serialize_cdr(types.types[JTC](bags.header(ns), names, *points), JTC))
            messages.append(Said("/arm_controller/state", ns, JTC, data))
    definition = joined([text, f"MSG: {POINT}", bags.definition(POINT)])
    path = raw_mcap(tmp_path / "log.mcap", messages, definitions={JTC: ("ros2msg", definition)})
    draft, log = drafted(path, model(tmp_path, joints))
    assert '[joint."grip".channels]\ncommand = false' in draft
    np.testing.assert_array_equal(log.q, q)
    last = np.arange(600) // 2 * 2
    assert log.command is not None
    np.testing.assert_array_equal(log.command[:, [3, 0, 2]], told[last])
    assert np.isnan(log.command[:, 1]).all()


def joined(texts: list[str]) -> str:
    first, *others = texts
    parts = [f"{SEPARATOR}\n{head}\n{body}" for head, body in zip(others[::2], others[1::2], strict=True)]
    return "\n".join([first, *parts])


# What the position follows.


def test_the_command_that_the_position_follows_is_chosen(tmp_path) -> None:
    """A leader's position is logged beside the command; the elbow is mounted the other way."""
    time = np.arange(1000) / 100.0
    q, told = waves(time, 2, 0.05), waves(time, 2)
    columns = {"t": time}
    for j, joint in enumerate(("shoulder", "elbow")):
        columns |= {
            f"{joint}_pos": q[:, j], f"{joint}_target": waves(time + 3.0, 2)[:, j],
            f"{joint}_goal": told[:, j] * (1 - 2 * j),
        }  # fmt: skip
    path = write_csv(tmp_path / "log.csv", columns)
    text = draft_joint_map(path, ["shoulder", "elbow"], [False, False]).text
    assert 'command = { column = "{joint}_goal"' in text
    assert "doubtful: elbow moves against it: sign = -1?" in text
    assert lag_ms(text) == pytest.approx(50.0, abs=1.0)


def test_a_time_that_cannot_be_read_leaves_the_lag_out(tmp_path) -> None:
    rows = "\n".join(f"noon,{0.1 * k},{0.1 * k},20" for k in range(100))
    (tmp_path / "log.csv").write_text(f"time,j_pos,j_goal,j_motor_cmd_kp\n{rows}\n", encoding="utf-8")
    text = draft_joint_map(tmp_path / "log.csv", ["j"], [False]).text
    assert "its values cannot be read" in text
    assert 'command = { column = "{joint}_goal"' in text
    assert 'position_gain = "free"\n' in text
    assert "follows" not in text
