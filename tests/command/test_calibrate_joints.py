"""``calibrate --model``: what it writes, prints and refuses."""

from __future__ import annotations

import json
from pathlib import Path

import mujoco
import numpy as np
import pytest

import mocobot
from command import refused, run
from discrepancy.joints.calibrated import from_dict
from made_arm import made, write_log


@pytest.fixture(scope="module")
def values() -> dict[str, np.ndarray]:
    return made(seconds=8.0)


@pytest.fixture
def log(tmp_path, values) -> Path:
    """A log with model and map beside it."""
    return write_log(tmp_path, values)


def test_the_folder_holds_model_table_numbers_and_report(tmp_path, capsys, log):
    code, out, _ = run(capsys, "calibrate", log, "--model", tmp_path / "arm.xml", "--out", tmp_path / "found")
    assert code == 0
    files = {path.name for path in (tmp_path / "found").iterdir()}
    assert {"as_found.xml", "calibration.json", "parameters.csv", "report.txt"} <= files
    assert out.startswith("The calibrated model leaves ")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "found" / "as_found.xml"))
    assert model.dof_damping == pytest.approx([1.0, 1.5, 0.5], rel=0.1)
    assert model.dof_frictionloss == pytest.approx([1.5, 2.0, 1.0], rel=0.1)
    stated = json.loads((tmp_path / "found" / "calibration.json").read_text())
    assert [file["name"] for file in stated["provenance"]["files"]] == ["arm.xml", "log.toml", "log.csv"]
    assert set(stated["provenance"]["options"]) == {
        "model",
        "map",
        "episode",
        "lock",
        "base",
        "max_unpacked",
        "same",
    }


def test_a_model_as_found_is_a_model_for_the_next_command(tmp_path, capsys, log):
    run(capsys, "calibrate", log, "--model", tmp_path / "arm.xml", "--out", tmp_path / "found")
    as_found = tmp_path / "found" / "as_found.xml"
    code, out, _ = run(capsys, "diagnose", log, "--model", as_found, "--no-closed-loop")
    assert code == 0
    assert "friction" not in out.split("\n\n", maxsplit=1)[0]


@pytest.mark.parametrize(
    "options",
    [
        ("--tilt",),
        ("--arm-masses",),
        ("--parallel-flanges",),
        ("--known-mass", "1"),
        ("--payload-of", "log.csv=a"),
    ],
)
def test_options_of_a_team_are_refused(tmp_path, capsys, log, options):
    said = refused(capsys, "calibrate", log, "--model", tmp_path / "arm.xml", *options)
    assert f"{options[0]} is of a team's robots" in said


def test_machines_of_one_kind_are_compared(tmp_path, capsys, log):
    """Elbow and shoulder stand for two legs; they have unlike friction."""
    same = ("--same", "elbow=shoulder")
    code, out, _ = run(
        capsys, "calibrate", log, "--model", tmp_path / "arm.xml", "--out", tmp_path / "found", *same
    )
    assert code == 0
    assert "elbow and shoulder differ by more than their errors in" in " ".join(out.split())
    told = json.loads((tmp_path / "found/calibration.json").read_text())["same"][0]
    own = {d["parameter"]: d["values"] for d in told["differences"]}
    assert own["coulomb_Nm"] == pytest.approx([1.0, 2.0], rel=0.1)
    assert told["probability"] < 0.01
    again = from_dict(json.loads((tmp_path / "found/calibration.json").read_text()), "").same[0]
    assert again.sentence in " ".join(out.split())
    assert run(capsys, "report", tmp_path / "found")[0] == 0
    assert again.sentence.split(":")[0] in (tmp_path / "found/report.html").read_text()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (
            ("--model", "arm.xml", "--same", "FL=FR"),
            "no joint with 'FL' in its name has one with 'FR' instead",
        ),
        (("--model", "arm.xml", "--same", "elbow"), "it must be LEFT=RIGHT, such as FL=FR"),
        (("--same", "elbow=shoulder"), "same compares joints of a single robot; it needs a model"),
    ],
)
def test_other_machines_are_refused(tmp_path, capsys, log, monkeypatch, options, said):
    monkeypatch.chdir(tmp_path)
    assert said in refused(capsys, "calibrate", log, *options)


def test_a_model_without_logs_is_refused(capsys, tmp_path, log):
    said = refused(capsys, "calibrate", "--model", tmp_path / "arm.xml")
    assert said == "mocobot: no log is given; name the logs of the robot's joints first, --model after them"


def test_lock_without_a_model_is_refused(capsys, tmp_path, log):
    assert "name the model with --model" in refused(capsys, "calibrate", log, "--lock", "elbow=0")


def test_a_locked_joint_is_no_joint_of_the_calibration(tmp_path, values):
    log = write_log(tmp_path, values)
    (tmp_path / "two.toml").write_text(
        (tmp_path / "log.toml").read_text().replace('"turret", "shoulder", "elbow"', '"turret", "shoulder"')
    )
    found = mocobot.calibrate(log, tmp_path / "arm.xml", lock=["elbow=0"], map=tmp_path / "two.toml")
    assert {p.place for p in found.found.parameters} >= {"turret", "shoulder"}
    assert "elbow" not in {p.place for p in found.found.parameters}


def test_nothing_is_overwritten_without_force(tmp_path, capsys, log):
    (tmp_path / "found").mkdir()
    (tmp_path / "found" / "mine.txt").write_text("mine")
    assert "found" in refused(
        capsys, "calibrate", log, "--model", tmp_path / "arm.xml", "--out", tmp_path / "found", "--force"
    )
    assert (tmp_path / "found" / "mine.txt").read_text() == "mine"
