"""``map`` without a model: the log tells whether it is of a team or of the joints of one robot."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

import mocobot
from command import run
from joint_logs import write_csv
from made_arm import chain, made, write_model

TIME = np.arange(400) / 100.0
NAMES = {
    "numbers from 1": ([f"{what}_{k}" for what in ("q", "dq", "tau") for k in range(1, 8)], 7, "joint_1"),
    "numbers from 0 behind joint": (
        [f"joint_{k}_{what}" for k in range(6) for what in ("position", "effort")], 6, "joint_0"
    ),
    "measured and target": (
        [*(f"actual_{what}_{k}" for what in ("q", "current") for k in range(6)), *(f"target_q_{k}" for k in range(6))],
        6, "joint_1",
    ),
    "names with dots": (
        [f"{joint}.{what}" for joint in ("shoulder_pan", "gripper") for what in ("pos", "goal_pos")], 2, "shoulder_pan"
    ),
    "names that end in joint": (
        [f"{joint}_joint/{what}" for joint in ("shoulder", "elbow") for what in ("position", "effort")], 2,
        "shoulder_joint",
    ),
    "units, and a prefix that all share": (
        [f"left_arm_J{k}_{what}" for k in range(1, 7) for what in ("angle_deg", "torque_Nm")], 6, "joint_1"
    ),
    "one joint": (["pos", "torque"], 1, "joint_1"),
}  # fmt: skip


def written(folder: Path, columns: Sequence[str]) -> Path:
    values = {"time": TIME} | {name: np.sin(TIME + k) for k, name in enumerate(columns)}
    return write_csv(folder / "log.csv", values)


@pytest.mark.parametrize("case", list(NAMES))
def test_an_arms_log_gets_a_map_of_joints(tmp_path, capsys, case):
    columns, joints, first = NAMES[case]
    code, out, err = run(capsys, "map", written(tmp_path, columns))
    assert code == 0
    assert f"{joints} joint" in err
    drafted = tomllib.loads(out)
    assert len(drafted["joints"]) == joints
    assert drafted["joints"][0] == first
    assert "q" in drafted["channels"]
    assert len(drafted["channels"]) == len(columns) / joints
    assert "# doubtful: named after the log" in out


def test_the_draft_without_a_model_reads_the_log_with_it(tmp_path, capsys):
    write_model(tmp_path)
    values = made(seconds=4.0)
    log = write_csv(tmp_path / "log.csv", values)
    assert run(capsys, "map", log, "--out", tmp_path / "log.toml")[0] == 0
    (read,) = mocobot.serial.read_logs(log, tmp_path / "arm.xml")
    np.testing.assert_array_equal(read.q[:, 2], values["elbow q"])
    code, _, err = run(capsys, "inspect", log, "--map", tmp_path / "log.toml")
    assert code == 2
    assert "inspect, watch, diagnose and replay read its log with --model" in err
    code, out, _ = run(
        capsys, "inspect", log, "--map", tmp_path / "log.toml", "--model", tmp_path / "arm.xml"
    )
    assert "ready for: a diagnosis from torques of 3 joints" in out


@pytest.mark.parametrize("where", ["a{robot}_{what}", "left {what}|right {what}"])
def test_a_teams_log_still_gets_a_map_of_robots(tmp_path, capsys, where):
    channels = [
        *(f"{what}{k}" for what in ("phi", "tau") for k in (1, 2, 3)),
        *(f"theta_{axis}" for axis in "zyx"),
    ]
    names = where.split("|") if "|" in where else [where.replace("{robot}", str(k)) for k in (1, 2)]
    log = written(tmp_path, [name.format(what=what) for name in names for what in channels])
    _, out, err = run(capsys, "map", log)
    assert "2 robots; nothing is doubtful" in err
    assert tomllib.loads(out)["level"] == "joint"


FRANKA = "std_msgs/Header header\nfloat64[7] q\nfloat64[7] q_d\nfloat64[7] dq\nfloat64[7] tau_J\nfloat64[7] dtau_J\n"


def test_the_state_of_a_franka_gets_a_map_of_joints(tmp_path, capsys):
    types, kind = get_typestore(Stores.ROS2_HUMBLE), "franka_msgs/msg/FrankaState"
    types.register(get_types_from_msg(FRANKA, kind))
    stamp, header = types.types["builtin_interfaces/msg/Time"], types.types["std_msgs/msg/Header"]
    q, torque = np.sin(TIME[:, None] + np.arange(7.0)), np.cos(TIME[:, None] + np.arange(7.0))
    with Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        topic = bag.add_connection("/franka/state", kind, typestore=types)
        for k, at in enumerate(TIME):
            head = header(stamp=stamp(sec=k // 100, nanosec=k % 100 * 10_000_000), frame_id="")
            said = types.types[kind](head, q[k], 0 * q[k], q[k], torque[k], 0 * q[k])
            bag.write(topic, round(1e9 * at), bytes(types.serialize_cdr(said, kind)))
    code, _, err = run(capsys, "map", tmp_path / "bag", "--out", tmp_path / "log.toml")
    assert code == 0
    assert "7 joints" in err
    (tmp_path / "arm.xml").write_text(chain(7).replace('"joint', '"joint_'), encoding="utf-8")
    (read,) = mocobot.serial.read_logs(tmp_path / "bag", tmp_path / "arm.xml", map=tmp_path / "log.toml")
    np.testing.assert_array_equal(read.q, q)
    np.testing.assert_array_equal(read.torque, torque)
    assert read.drive.link_side.all()
