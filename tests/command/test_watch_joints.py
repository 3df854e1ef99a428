"""``watch --model``: inspect and diagnose the logs of one robot, in a folder, and as they come."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

import mocobot
from command import refused, run
from joint_logs import write_csv
from made_arm import made, write_log
from mocobot.api import watch_joints


@pytest.fixture
def arm(tmp_path) -> Path:
    """A folder with model and map, and one with two logs."""
    (tmp_path / "logs").mkdir()
    write_log(tmp_path, made(seconds=1.0))
    for number in (1, 2):
        write_csv(tmp_path / "logs" / f"run{number}.csv", made(seconds=4.0, seed=number))
    return tmp_path


def flat(text: str) -> str:
    return " ".join(text.split())


def test_a_folder_of_logs_is_inspected_and_diagnosed_together(arm, capsys):
    shutil.copy(arm / "log.toml", arm / "logs")
    out = arm / "seen"
    code, said, _ = run(capsys, "watch", arm / "logs", "--model", arm / "arm.xml", "--out", out, "--strict")
    assert code == 0
    for number in (1, 2):
        assert f"run{number}.csv: ready for: a diagnosis from torques of 3 joints." in flat(said)
    assert "Against the model: EXPLAINED. Friction in all joints" in said
    assert f"mocobot calibrate {arm / 'logs' / 'run1.csv'} {arm / 'logs' / 'run2.csv'} --model" in said
    values = json.loads((out / "diagnosis.json").read_text())
    assert values["recordings"] == ["run1", "run2"]
    assert {Path(entry["path"]).name for entry in values["provenance"]["files"]} >= {
        "run1.csv",
        "run2.csv",
        "arm.xml",
    }
    assert (out / "extended" / "robot.xml").is_file()
    assert "Diagnosis of a robot in 2 trials" in (out / "report.html").read_text(encoding="utf-8")
    assert mocobot.watch(arm / "logs", model=arm / "arm.xml").good


def test_a_reference_in_the_folder_is_no_log_of_today(arm, capsys):
    write_csv(arm / "logs" / "today.csv", made(seconds=4.0, seed=3, payload_kg=0.5))
    (arm / "logs" / "run2.csv").unlink()
    before = arm / "logs" / "run1.csv"
    _, said, _ = run(capsys, "watch", arm / "logs", "--model", arm / "arm.xml", "--reference", before)
    assert "run1.csv: ready" not in said
    assert "Against the reference: EXPLAINED. Link fore carries 0." in said


def test_a_log_with_a_wrong_sign_is_left_out_with_what_is_wrong(arm, capsys):
    values = made(seconds=4.0)
    log = write_csv(arm / "wrong.csv", values | {"elbow torque": -values["elbow torque"]})
    code, said, err = run(capsys, "watch", log, "--model", arm / "arm.xml", "--strict")
    assert code == 1
    assert "torque of elbow has the wrong sign" in flat(said)
    assert said.endswith("Nothing can be diagnosed: no log is ready.\n")
    assert "no log is ready" in err


def test_new_and_growing_logs_are_told_once_they_stop_growing(arm, capsys, monkeypatch):
    folder, whole = arm / "logs", (arm / "logs" / "run2.csv").read_text().splitlines(keepends=True)
    (folder / "run2.csv").unlink()
    steps = iter(
        [
            lambda: (folder / "run2.csv").write_text("".join(whole[:400])),
            lambda: (folder / "run2.csv").write_text("".join(whole[:700])),
            lambda: (folder / "bad.csv").write_text("nothing\n"),
            lambda: None,
            lambda: (folder / "run2.csv").write_text("".join(whole)),
            lambda: None,
            lambda: None,
        ]
    )

    def pause(_: float) -> None:
        try:
            next(steps)()
        except StopIteration:
            raise KeyboardInterrupt from None

    monkeypatch.setattr(watch_joints, "sleep", pause)
    code, said, _ = run(
        capsys, "watch", folder, "--model", arm / "arm.xml", "--follow", "--map", arm / "log.toml"
    )
    assert code == 0
    told = [line.partition(": ")[0] for line in said.splitlines() if line.startswith(str(folder))]
    assert [Path(name).name for name in told] == ["run1.csv", "run2.csv", "bad.csv", "run2.csv"]
    assert "bad.csv: left out, " in said
    assert said.count("Against the model: ") == 3


def test_what_is_refused(arm, capsys):
    (arm / "empty").mkdir()
    model = ("--model", arm / "arm.xml")
    log = arm / "logs" / "run1.csv"
    assert "holds no log; a log is a rosbag2" in refused(capsys, "watch", arm / "empty", *model)
    assert "--reference goes with a model" in refused(
        capsys, "watch", log, "--reference", arm / "logs" / "run2.csv"
    )
    assert "--follow goes with a model" in refused(capsys, "watch", log, "--follow")
    said = refused(capsys, "watch", log, *model, "--follow", "--out", arm / "seen")
    assert "--follow and --out are both given" in said
    assert "is given twice" in refused(capsys, "watch", log, *model, "--reference", log)
    assert not (arm / "seen").exists()
