"""What a refusal of a log advises works when it is followed."""

from __future__ import annotations

import shlex
from pathlib import Path

import numpy as np
import pytest

from command import refused, run
from estimator.recording.model import Recording
from joint_logs import motion, write_csv, write_lerobot
from log_files import write_lerobot as write_team
from log_files import write_text
from made_arm import made, write_log, write_map, write_model
from mocobot import serial
from mocobot_sim.trial.sensors import PRESETS, measure
from recordings import small_recording

MODEL = """
<mujoco><worldbody>
  <body><inertial mass="2" pos="0.1 0 0" diaginertia="0.02 0.02 0.02"/><joint name="hip" axis="0 1 0"/>
    <body pos="0.3 0 0"><inertial mass="1" pos="0.1 0 0" diaginertia="0.01 0.01 0.01"/><joint name="knee" axis="0 1 0"/>
      <body pos="0.2 0 0"><inertial mass="1" pos="0 0 0" diaginertia="0.01 0.01 0.01"/>
        <joint name="lift" type="slide" axis="0 0 1"/></body></body></body>
</worldbody></mujoco>
"""
MAP = """
joints = ["hip", "knee", "lift"]
[channels]
q = { column = "observation.state.{joint}.pos", unit = "rad" }
command = { column = "action.{joint}.pos", unit = "rad" }
[joint.lift.channels]
q.unit = "m"
command.unit = "m"
[control]
command = "position"
"""


@pytest.fixture
def dataset(tmp_path) -> Path:
    """Two episodes of a robot that follows its commands late."""
    time = np.arange(300) / 50.0
    model = tmp_path / "robot.xml"
    model.write_text(MODEL)
    write_map(tmp_path, MAP)
    q, action = motion(time)[0], motion(time + 0.04)[0]
    return write_lerobot(
        tmp_path / "set", np.vstack([q, 0.5 * q]), np.vstack([action, 0.5 * action]), 50.0, 2
    )


@pytest.mark.parametrize("command", ["map", "inspect"])
def test_an_episode_of_a_robots_dataset(tmp_path, capsys, dataset, command) -> None:
    arguments = [command, dataset, "--model", tmp_path / "robot.xml"]
    assert refused(capsys, *arguments).endswith("holds 2 episodes, 0 to 1; say which one with --episode")
    assert refused(capsys, *arguments, "--episode", 2).endswith("there is no episode 2; it holds 2, 0 to 1")
    assert run(capsys, *arguments, "--episode", 1)[0] == 0


def test_all_episodes_are_logs(tmp_path, dataset) -> None:
    """So a diagnosis may test what it finds in one on the others."""
    first, second = serial.read_logs(dataset, tmp_path / "robot.xml")
    assert [log.name for log in (first, second)] == [f"{dataset} (episode {k})" for k in (0, 1)]
    for log, episode in ((first, 0), (second, 1)):
        (alone,) = serial.read_logs(dataset, tmp_path / "robot.xml", episode=episode)
        assert alone.name == str(dataset)
        np.testing.assert_array_equal(alone.q, log.q)
    np.testing.assert_allclose(second.q, 0.5 * first.q, atol=1e-6)


def test_episodes_of_a_diagnosis_and_a_replay(tmp_path, capsys, monkeypatch, dataset) -> None:
    """A diagnosis without a torque is none; that is what is refused, and no longer the dataset."""
    monkeypatch.chdir(tmp_path)
    for more in ([], ["--episode", 1]):
        message = refused(capsys, "diagnose", dataset, "--model", "robot.xml", *more)
        assert "there are no torques, currents or duties, nor commands with known gains" in message
        out = f"out{len(more)}.rrd"
        assert run(capsys, "replay", dataset, "--model", "robot.xml", *more, "--out", out)[0] == 0
        assert Path(out).stat().st_size > 1000
    for command in (["diagnose"], ["replay", "--out", "none.rrd"]):
        message = refused(capsys, *command, dataset, "--model", "robot.xml", "--episode", 2)
        assert message.endswith("there is no episode 2; it holds 2, 0 to 1")


@pytest.fixture(scope="module")
def team(random_a, tmp_path_factory) -> Path:
    recording: Recording = measure(random_a, PRESETS["nominal"], np.random.default_rng(2), payload="a")
    return write_team(tmp_path_factory.mktemp("team") / "set", [recording, recording])


@pytest.mark.parametrize(
    "command",
    [
        ("map",), ("inspect",), ("convert", "rec.parquet"), ("estimate",), ("calibrate",),
        ("diagnose", "--no-closed-loop", "--jobs", "1", "--seconds", "1"), ("watch", "--jobs", "1"),
    ],
    ids=lambda words: words[0],
)  # fmt: skip
def test_an_episode_of_a_teams_dataset(tmp_path, capsys, monkeypatch, team, command) -> None:
    monkeypatch.chdir(tmp_path)
    arguments = [command[0], team, *command[1:]]
    assert "holds 2 episodes, 0 to 1; say which one with --episode" in refused(capsys, *arguments)
    assert "there is no episode 2" in refused(capsys, *arguments, "--episode", 2)
    assert run(capsys, *arguments, "--episode", 1)[0] == 0


def test_an_episode_of_a_recording(tmp_path, capsys) -> None:
    log = write_text(tmp_path / "log.csv", dict(small_recording(rows=200).columns()))
    for command in ("inspect", "estimate", "diagnose", "calibrate"):
        message = refused(capsys, command, log, "--episode", 0)
        assert "is not a LeRobot dataset, so it has no episode 0" in message


def _spoilt(change: str) -> dict[str, np.ndarray]:
    columns = dict(small_recording(rows=2600, ref=False).columns())
    if change == "infinite":
        columns["omnid3.phi2"] = np.where(np.arange(2600) == 77, np.inf, columns["omnid3.phi2"])
    if change == "hole":
        return {
            name: values[(np.arange(2600) < 1200) | (np.arange(2600) >= 1230)]
            for name, values in columns.items()
        }
    if change == "early":
        late = np.arange(2600) >= 2400
        return {n: np.where(late, np.nan, x) if n.startswith("omnid2") else x for n, x in columns.items()}
    return columns


@pytest.mark.parametrize(
    ("change", "advised", "followed"),
    [
        ("infinite", "convert --drop leaves samples out", ["--drop", "robot=3:0.77-0.77"]),
        ("hole", "convert --split-at-gaps makes trials of the parts between gaps", ["--split-at-gaps"]),
        ("hole", "--crop keeps one part", ["--crop", "0:11.9"]),
        ("early", "convert --crop keeps what all have", ["--crop", "0:23.9"]),
    ],
)
def test_parts_of_a_teams_log(tmp_path, capsys, change, advised, followed) -> None:
    log = write_text(tmp_path / "log.csv", _spoilt(change))
    for command in (["convert", log, tmp_path / "rec.parquet"], ["estimate", log]):
        assert advised in refused(capsys, *command)
    assert run(capsys, "convert", log, tmp_path / "rec.parquet", *followed)[0] == 0


def test_no_map_was_given(tmp_path, capsys) -> None:
    """The command in the message can be typed as it is, whatever the folder is called."""
    folder = tmp_path / "my robot's"
    folder.mkdir()
    model, log = write_model(folder), write_csv(folder / "my log.csv", made(seconds=2.0))
    message = refused(capsys, "inspect", log, "--model", model)
    words = shlex.split(message.split("draft one with ")[1])
    assert words[0] == "mocobot"
    assert run(capsys, *words[1:])[0] == 0
    assert run(capsys, "inspect", log, "--model", model)[0] == 0


def test_a_robots_map_is_no_teams(tmp_path, capsys) -> None:
    log = write_log(tmp_path, made(seconds=6.0))
    message = refused(capsys, "inspect", log, "--map", tmp_path / "log.toml")
    assert "inspect, watch, diagnose and replay read its log with --model" in message
    for command in ("inspect", "diagnose"):
        arguments = [command, log, "--map", tmp_path / "log.toml", "--model", tmp_path / "arm.xml"]
        more = ["--no-closed-loop", "--seconds", "1"] if command == "diagnose" else []
        assert run(capsys, *arguments, *more)[0] == 0


def test_a_joint_that_lacks_a_channel(tmp_path, capsys) -> None:
    """``CHANNEL = false`` in the joint's table of the map."""
    values = made(seconds=2.0)
    torque = values["elbow torque"]
    log = write_log(tmp_path, values | {"elbow torque": np.where(np.arange(len(torque)) % 3, torque, np.nan)})
    message = run(capsys, "inspect", log, "--model", tmp_path / "arm.xml")[1]
    assert "a joint without such a column says so in the map: CHANNEL = false" in message
    text = (tmp_path / "log.toml").read_text()
    write_map(tmp_path, f"{text}\n[joint.elbow.channels]\ntorque = false\n")
    out = run(capsys, "inspect", log, "--model", tmp_path / "arm.xml")[1]
    assert out.endswith("ready for: a diagnosis from torques of 2 joints\n")


def test_absurd_values_of_a_joint(tmp_path, capsys) -> None:
    """Their cells may be empty."""
    values = made(seconds=2.0)
    for absurd in (np.inf, 1e200):
        torque = values["elbow torque"].copy()
        torque[7] = absurd
        log = write_log(tmp_path, values | {"elbow torque": torque})
        message = refused(capsys, "diagnose", log, "--model", tmp_path / "arm.xml")
        assert "in row 7; every value must be finite (a cell may be empty)" in message
        assert "--drop" not in message
        torque[7] = np.nan
        log = write_log(tmp_path, values | {"elbow torque": torque})
        assert run(capsys, "inspect", log, "--model", tmp_path / "arm.xml", "--strict")[0] == 0
