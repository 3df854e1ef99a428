"""What a replay of a joint log draws: MuJoCo's poses, the model's torques, bones where a model shows nothing."""

from __future__ import annotations

import re

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from joint_logs import write_csv
from made_arm import JOINTS, MODEL, made, write_log, write_map, write_model
from mocobot import serial
from mocobot_view.joint_replay import joint_replay


def test_bodies_are_where_mujoco_puts_them(tmp_path) -> None:
    (log,) = serial.read_logs(write_log(tmp_path, made(seconds=2.0)), tmp_path / "arm.xml")
    model = serial.read_model(tmp_path / "arm.xml")
    drawn = joint_replay(model, log, "log")
    assert set(drawn.shapes) == {"turret", "upper", "fore"}
    data = mujoco.MjData(model.model)
    for k in (0, len(drawn.time) - 1):
        data.qpos[:] = log.q[np.argmin(np.abs(log.time - drawn.time[k]))]
        mujoco.mj_forward(model.model, data)
        for body in drawn.shapes:
            np.testing.assert_allclose(drawn.position[body][k], data.body(body).xpos, atol=1e-9)
            turn = Rotation.from_quat(drawn.quaternion[body][k]).as_matrix()
            np.testing.assert_allclose(turn.ravel(), data.body(body).xmat, atol=1e-9)


def test_torques_of_the_model_are_those_of_a_log_without_friction(tmp_path) -> None:
    write_model(tmp_path)
    write_map(tmp_path)
    values = made(seconds=4.0, heavier=1.0)
    time = values["time"]
    smooth = np.array([0.4, 0.3, 0.5]) * np.sin(np.multiply.outer(time, [2.0, 3.0, 4.0]))
    rates = np.array([0.8, 0.9, 2.0]) * np.cos(np.multiply.outer(time, [2.0, 3.0, 4.0]))
    bends = -np.array([1.6, 2.7, 8.0]) * np.sin(np.multiply.outer(time, [2.0, 3.0, 4.0]))
    model = mujoco.MjModel.from_xml_string(MODEL)
    data = mujoco.MjData(model)
    for k in range(len(time)):
        data.qpos[:], data.qvel[:], data.qacc[:] = smooth[k], rates[k], bends[k]
        mujoco.mj_inverse(model, data)
        for j, joint in enumerate(JOINTS):
            values[f"{joint} q"][k], values[f"{joint} torque"][k] = smooth[k, j], data.qfrc_inverse[j]
    (log,) = serial.read_logs(write_csv(tmp_path / "log.csv", values), tmp_path / "arm.xml")
    drawn = joint_replay(serial.read_model(tmp_path / "arm.xml"), log, "log")
    inner = slice(50, -50)
    asked = drawn.asked[inner]
    np.testing.assert_allclose(asked, log.torque[:: drawn.every][inner], atol=0.01 * np.abs(asked).max())


def test_a_model_that_shows_nothing_gets_bones(tmp_path) -> None:

    log = write_log(tmp_path, made(seconds=2.0))
    (tmp_path / "arm.xml").write_text(re.sub(r"<geom .*/>", "", MODEL), encoding="utf-8")
    (read,) = serial.read_logs(log, tmp_path / "arm.xml")
    drawn = joint_replay(serial.read_model(tmp_path / "arm.xml"), read, "log")
    upper = drawn.shapes["upper"].triangles.vertices
    assert upper[:, 2].max() == pytest.approx(0.4, abs=0.03)  # up to where the next body begins
    assert set(drawn.shapes) == {"turret", "upper", "fore"}
