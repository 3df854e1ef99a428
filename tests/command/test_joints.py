"""The commands with ``--model``: outputs, exit codes, and that nothing is written where something is refused."""

from __future__ import annotations

import json
import random
import re
import tomllib
from pathlib import Path

import mujoco
import numpy as np
import pytest
from rerun.chunk import RrdReader

from command import refused, run
from discrepancy.cause_names import JOINTS as CAUSES
from estimator.errors import InputError
from joint_logs import write_csv
from made_arm import JOINTS, MAP, MODEL, made, write_chain_log, write_log, write_map, write_model
from mocobot import serial


@pytest.fixture(scope="module")
def values() -> dict[str, np.ndarray]:
    return made(seconds=4.0)


@pytest.fixture
def log(tmp_path, values) -> Path:
    """A log with model and map beside it."""
    return write_log(tmp_path, values)


def files(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def test_inspect_says_and_writes_what_it_finds(tmp_path, capsys, log):
    code, out, _ = run(
        capsys, "inspect", log, "--model", tmp_path / "arm.xml", "--json", tmp_path / "found.json", "--strict"
    )
    assert code == 0
    assert "[[Motion and torques]]" in out
    assert out.endswith("ready for: a diagnosis from torques of 3 joints\n")
    assert json.loads((tmp_path / "found.json").read_text())["ready"].startswith("ready for: a diagnosis")


def test_inspect_strict_fails_where_something_is_reversed(tmp_path, capsys, values):
    log = write_log(tmp_path, values | {"shoulder torque": -values["shoulder torque"]})
    code, out, err = run(capsys, "inspect", log, "--model", tmp_path / "arm.xml", "--strict")
    assert code == 1
    assert "torque of shoulder has the wrong sign" in out
    assert err.startswith("mocobot: ready for: nothing as it is; with the mistake above undone")


def test_a_drafted_map_reads_the_log(tmp_path, capsys, values):
    write_model(tmp_path)
    log = write_csv(tmp_path / "log.csv", values)
    code, _, err = run(capsys, "map", log, "--model", tmp_path / "arm.xml", "--out", tmp_path / "log.toml")
    assert code == 0
    assert "3 joints" in err
    (read,) = serial.read_logs(log, tmp_path / "arm.xml")
    for j, joint in enumerate(JOINTS):
        np.testing.assert_array_equal(read.q[:, j], values[f"{joint} q"])
        np.testing.assert_array_equal(read.torque[:, j], values[f"{joint} torque"])
        np.testing.assert_array_equal(read.dq[:, j], values[f"{joint} dq"])


def test_drafts_by_numbers_and_units_in_names(tmp_path, capsys, values):
    write_model(tmp_path)
    named = {"t_ms": 1e3 * values["time"], "unrelated": values["time"]}
    for k, joint in enumerate(JOINTS):
        named |= {f"motor_pos_{k}_deg": np.degrees(50 * values[f"{joint} q"])}
        named |= {
            f"motor_current_{k}_mA": 1e3 * values[f"{joint} torque"],
            f"goal_pos_{k}_deg": np.degrees(values[f"{joint} q"]),
        }
    log = write_csv(tmp_path / "log.csv", named)
    _, out, _ = run(capsys, "map", log, "--model", tmp_path / "arm.xml")
    drafted = tomllib.loads(out)
    assert drafted["time"] == {"column": "t_ms", "unit": "ms"}
    assert drafted["channels"]["motor_position"] == {"column": "motor_pos_{index}_deg", "unit": "deg"}
    assert drafted["channels"]["current"] == {"column": "motor_current_{index}_mA", "unit": "mA"}
    assert drafted["channels"]["command"] == {"column": "goal_pos_{index}_deg", "unit": "deg"}
    assert drafted["control"] == {"command": "position"}
    assert "# not used: unrelated" in out
    assert "# gear = [ ... ]" in out


def test_replay_writes_bodies_and_series(tmp_path, capsys, log):
    code, out, _ = run(capsys, "replay", log, "--model", tmp_path / "arm.xml", "--save", tmp_path / "log.rrd")
    assert code == 0
    assert "open it with: rerun" in out
    entities = {str(path) for path in RrdReader(tmp_path / "log.rrd").store().schema().entity_paths()}
    assert {f"/log/robot/{body}/shape" for body in ("turret", "upper", "fore")} <= entities
    assert {f"/log/series/{joint}/torque/model" for joint in JOINTS} <= entities


REFUSED = {
    "no map": (["diagnose", "{log}", "--model", "{model}"], "no map was given (--map)", ["log.toml"]),
    "no model": (["diagnose", "{log}", "--model", "{folder}/none.xml"], "none.xml: there is no such file", []),
    "log as model": (["diagnose", "{log}", "--model", "{log}"], "not a readable MJCF or URDF", []),
    "no log": (["diagnose", "{folder}/none.csv", "--model", "{model}"], "none.csv: there is no such file", []),
    "log twice": (["diagnose", "{log}", "{log}", "--model", "{model}"], "is given twice, and would count twice", []),
    "log as its reference": (
        ["diagnose", "{log}", "--reference", "{log}", "--model", "{model}"], "is given twice", []
    ),
    "reference without model": (["diagnose", "{log}", "--reference", "{log}"], "--reference goes with a model", []),
    "unknown cause": (
        ["diagnose", "{log}", "--model", "{model}", "--exclude", "sorcery"], "cause 'sorcery' does not exist", []
    ),
    "calibration": (
        ["diagnose", "{log}", "--model", "{model}", "--calibration", "c.json"], "--calibration is of a team's", []
    ),
    "laws": (["diagnose", "{log}", "--model", "{model}", "--laws", "always"], "--laws is of a team's robots", []),
    "odds": (["diagnose", "{log}", "--model", "{model}", "--odds", "0.7"], "--odds is of a team's robots", []),
    "whole": (["diagnose", "{log}", "--model", "{model}", "--whole"], "--whole is of a team's robots", []),
    "processes": (["diagnose", "{log}", "--model", "{model}", "--jobs", "3"], "--jobs is of a team's robots", []),
    "no time": (
        ["diagnose", "{log}", "--model", "{model}", "--seconds", "0"], "--seconds is 0; it must be above 0", []
    ),
    "jobs": (["diagnose", "{log}", "--model", "{model}", "--jobs", "0"], "jobs is 0; it must be at least 1", []),
    "output over the model": (["inspect", "{log}", "--model", "{model}", "--json", "{model}"], "is an input", []),
    "design": (["inspect", "{log}", "--model", "{model}", "--design", "d.toml"], "--design is of a team's robots", []),
    "map over the log": (["map", "{log}", "--model", "{model}", "--out", "{log}"], "is an input", []),
    "replay of a truth": (
        ["replay", "{log}", "--model", "{model}", "--truth", "--save", "{folder}/x.rrd"], "--truth is of a team's", []
    ),
    "map of a replay": (
        ["replay", "{log}", "--map", "log.toml", "--save", "{folder}/x.rrd"], "--map goes with a model", []
    ),
    "folder of the log": (
        ["diagnose", "{log}", "--model", "{model}", "--out", "{folder}"], "which would be lost; name another folder", []
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", list(REFUSED))
def test_refused_and_nothing_written(tmp_path, capsys, log, case):
    arguments, said, without = REFUSED[case]
    for name in without:
        (tmp_path / name).unlink()
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    filled = [a.format(log=log, model=tmp_path / "arm.xml", folder=tmp_path) for a in arguments]
    assert said in refused(capsys, *filled)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_a_log_without_torques_or_a_model_with_other_joints(tmp_path, capsys, values):
    log = write_log(tmp_path, values)
    write_map(tmp_path, MAP.replace('torque = { column = "{joint} torque", unit = "Nm" }\n', ""))
    assert "no joint has a torque, a current, a command or a duty" in refused(
        capsys, "diagnose", log, "--model", tmp_path / "arm.xml", "--out", tmp_path / "verdict"
    )
    write_map(tmp_path)
    (tmp_path / "arm.xml").write_text(MODEL.replace('name="elbow"', 'name="ellbow"'), encoding="utf-8")
    assert "unknown joint 'elbow' (did you mean 'ellbow'?)" in refused(
        capsys, "diagnose", log, "--model", tmp_path / "arm.xml", "--out", tmp_path / "verdict"
    )
    assert files(tmp_path) == {"arm.xml", "log.toml", "log.csv"}


def test_damaged_logs_maps_and_models_leave_nothing_behind(tmp_path, capsys, values):
    """One of the three is damaged so that it cannot be read; see tests/logs/joints for hundreds of them."""
    log = write_log(tmp_path, values)
    originals = {path: path.read_bytes() for path in tmp_path.iterdir()}
    count = 0
    for seed in range(30):
        rng = random.Random(seed)
        path = rng.choice(sorted(originals))
        content = bytearray(originals[path])
        at = rng.randrange(len(content) // 2)
        content[at : at + 40] = bytes(rng.randrange(256) for _ in range(40))
        path.write_bytes(content)
        code, _, err = run(
            capsys, "inspect", log, "--model", tmp_path / "arm.xml", "--json", tmp_path / "found.json"
        )
        assert code in (0, 2), err
        if code == 2:
            count += 1
            assert err.startswith("mocobot: ")
            assert err.isprintable()
            assert files(tmp_path) == {"arm.xml", "log.toml", "log.csv"}
        else:
            (tmp_path / "found.json").unlink()
        path.write_bytes(originals[path])
    assert count > 10


def test_tolerances_of_the_causes_that_a_file_names(tmp_path, log):
    path = tmp_path / "tolerances.toml"
    path.write_text("[torque_scale]\nscale_percent = 2.0\n", encoding="utf-8")
    with pytest.raises(InputError, match="torque_scale has no 'scale_percent'; its parameters are"):
        serial.diagnose(tmp_path / "arm.xml", log, tolerances=path)


@pytest.mark.slow
@pytest.mark.parametrize("joints", [1, 7])
def test_every_command_takes_a_cause_at_the_last_joint(tmp_path, capsys, joints):
    log, model, found = write_chain_log(tmp_path, joints, joints), tmp_path / "arm.xml", tmp_path / "found"
    others = [name for name in CAUSES if name != "friction"]
    code, _, _ = run(
        capsys, "diagnose", log, "--model", model, "--out", found, "--no-closed-loop", "--exclude", *others,
    )  # fmt: skip
    assert code == 0
    (cause,) = json.loads((found / "diagnosis.json").read_text())["causes"]
    assert (cause["cause"], cause["robot"], cause["joint"]) == ("friction", None, joints)
    code, _, _ = run(capsys, "report", found, "--out", tmp_path / "page.html")
    assert code == 0
    assert f"friction in joint {joints}" in (tmp_path / "page.html").read_text()
    code, said, _ = run(capsys, "compare", found, found)
    assert code == 0
    assert f"friction in joint {joints}, coulomb_Nm" in said
    code, _, _ = run(capsys, "replay", log, "--model", model, "--save", tmp_path / "log.rrd")
    assert code == 0
    entities = {str(path) for path in RrdReader(tmp_path / "log.rrd").store().schema().entity_paths()}
    assert f"/log/series/joint{joints}/torque/model" in entities


WITH_FINGERS = MODEL.replace(
    '<geom type="capsule" fromto="0 0 0 0 0 0.3" size="0.03" mass="0"/>',
    '<body name="left" pos="0 0 0.3"><inertial pos="0 0 0" mass="0.1" diaginertia="1e-4 1e-4 1e-4"/>'
    '<joint name="left" type="slide" axis="0 1 0" range="0 0.04"/></body>'
    '<body name="right" pos="0 0 0.3"><inertial pos="0 0 0" mass="0.1" diaginertia="1e-4 1e-4 1e-4"/>'
    '<joint name="right" type="slide" axis="0 -1 0" range="0 0.04"/></body>',
)
"""The arm with a gripper that was not logged."""


def test_what_was_not_logged_is_locked_as_the_refusal_says(tmp_path, capsys, log) -> None:
    (tmp_path / "arm.xml").write_text(WITH_FINGERS, encoding="utf-8")
    said = refused(capsys, "inspect", log, "--model", tmp_path / "arm.xml")
    assert "joints lacks 'left', 'right'" in said
    advice = re.findall(r"--lock (\S+?)[,;]", said)
    assert advice == ["left=0"]
    locks = ["--lock", *advice, "--lock", "right=0.04"]
    code, out, _ = run(capsys, "inspect", log, "--model", tmp_path / "arm.xml", *locks)
    assert code == 0
    assert "Joints are locked: left=0, right=0.04." in out
    assert out.endswith("ready for: a diagnosis from torques of 3 joints\n")
    assert "its range in the model is 0 to 0.04 m" in refused(
        capsys,
        "replay",
        log,
        "--model",
        tmp_path / "arm.xml",
        "--lock",
        "left=4",
        "--out",
        tmp_path / "a.rrd",
    )
    assert "name the model with --model" in refused(capsys, "inspect", log, "--base", "fore")
    assert files(tmp_path) == {"arm.xml", "log.csv", "log.toml"}


def test_a_part_of_a_model_from_python(tmp_path, log) -> None:
    (tmp_path / "arm.xml").write_text(WITH_FINGERS, encoding="utf-8")
    arm = serial.read_model(tmp_path / "arm.xml", lock={"left": 0.01, "right": "0.02 m"})
    assert arm.joints == JOINTS
    assert serial.inspect(log, tmp_path / "arm.xml", lock={"left": 0.01, "right": 0.02}).is_ready
    fore = serial.read_model(tmp_path / "arm.xml", lock=["left=0", "right=0"], base="fore")
    assert fore.joints == ("elbow",)
    with pytest.raises(InputError, match="already read"):
        serial.inspect(log, arm, base="fore")


def test_an_arm_whose_joints_follow_others_is_diagnosed_and_simulated(tmp_path, capsys) -> None:
    """A parallelogram: the hand turns against the fore arm; friction of 0.6 N m + 0.3 N m s/rad at the elbow is new."""
    tied = MODEL.replace(
        '<geom type="capsule" fromto="0 0 0 0 0 0.3" size="0.03" mass="0"/>',
        '<body name="hand" pos="0 0 0.3"><inertial pos="0.1 0 0" mass="1" diaginertia="0.004 0.004 0.004"/>'
        '<joint name="level" axis="0 1 0"/></body>',
    ).replace(
        "</mujoco>",
        '<equality><joint joint1="level" joint2="elbow" polycoef="0 -1 0 0 0"/></equality></mujoco>',
    )
    (tmp_path / "arm.xml").write_text(tied, encoding="utf-8")
    time = np.arange(3000) / 250.0
    rate = 2 * np.pi * np.array([[0.31, 0.23, 0.41], [0.17, 0.47, 0.13]])
    angle = time[:, None, None] * rate + np.array([[0.0, 1.0, 2.0], [0.5, 0.1, 3.0]])
    q, dq, ddq = (
        x.sum(axis=1) * 0.4 for x in (np.sin(angle), rate * np.cos(angle), -(rate**2) * np.sin(angle))
    )
    full = mujoco.MjModel.from_xml_path(str(tmp_path / "arm.xml"))
    full.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    spread = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, -1.0]])
    data, torque = mujoco.MjData(full), np.empty_like(q)
    for k in range(len(time)):
        data.qpos[:], data.qvel[:], data.qacc[:] = spread @ q[k], spread @ dq[k], spread @ ddq[k]
        mujoco.mj_inverse(full, data)
        torque[k] = spread.T @ data.qfrc_inverse
    torque[:, 2] += 0.6 * np.tanh(dq[:, 2] / 1e-3) + 0.3 * dq[:, 2]
    torque += 0.01 * np.random.default_rng(0).standard_normal(torque.shape)
    columns = {"time": time}
    for j, name in enumerate(JOINTS):
        columns |= {f"{name} q": q[:, j], f"{name} dq": dq[:, j], f"{name} torque": torque[:, j]}
    write_map(tmp_path)
    log, out = write_csv(tmp_path / "log.csv", columns), tmp_path / "out"
    code, said, err = run(capsys, "diagnose", log, "--model", tmp_path / "arm.xml", "--out", out)
    assert code == 0, err
    assert "Joints that follow others are no joints of their own: level." in said
    values = json.loads((out / "diagnosis.json").read_text())
    (cause,) = values["causes"]
    assert (cause["cause"], cause["joint"]) == ("friction", 3)
    assert abs(cause["parameters"]["coulomb_Nm"]["value"] - 0.6) < 0.02
    assert abs(cause["parameters"]["viscous_Nms_per_rad"]["value"] - 0.3) < 0.02
    built = mujoco.MjModel.from_xml_path(str(out / "extended" / "robot.xml"))
    assert built.neq == 1
    assert abs(built.joint("elbow").frictionloss[0] - 0.6) < 0.02
    (first, *_) = values["rollouts"]["horizons"]
    assert first["before"]["rms"][2] > 10 * first["after"]["rms"][2] > 0
