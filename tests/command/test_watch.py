"""From logs to a first verdict with one command."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NoReturn

import pytest

import mocobot
from command import refused, run
from estimator.errors import InputError
from estimator.recording.parquet import read_recording, write_recording
from log_files import write_text
from mocobot import commands
from mocobot.api import watch
from recordings import small_recording


@pytest.fixture(scope="module")
def trial(tmp_path_factory) -> Path:
    """A short trial of robots as designed."""
    path = tmp_path_factory.mktemp("watch") / "monday.parquet"
    mocobot.simulate("b", vias=9, seed=5).write(path)
    return path


@pytest.fixture
def no_diagnosis(monkeypatch) -> list[dict[str, Any]]:
    """In place of the diagnosis, which takes long: what it was asked, and a refusal; no pictures on the page."""
    asked: list[dict[str, Any]] = []

    def refuse(recordings: Any, **options: Any) -> NoReturn:
        asked.append(options | {"recordings": list(recordings)})
        raise InputError("there are too few of them")

    monkeypatch.setattr(watch, "diagnose", refuse)
    monkeypatch.setattr(watch, "write_report", lambda _, page, __: page.write_text("the page"))
    return asked


@pytest.mark.slow
def test_a_healthy_team(trial, tmp_path, capsys):
    """All of it in one folder, with a page, and the same numbers as from the commands one by one."""
    out = tmp_path / "new" / "seen"
    code, said, _ = run(capsys, "watch", trial, "--out", out, "--strict", "--jobs", 1)
    assert code == 0
    text = " ".join(said.split())
    assert "ready for: grasps yes, mass yes, centre of mass yes, inertia yes." in text
    assert "Robots: they agree with each other as designed." in text
    assert "Against the simulation: CONSISTENT." in text
    assert f"The page with all of it: {out / 'report.html'}." in text
    found = json.loads((out / "estimate.json").read_text())
    alone = mocobot.estimate(trial).to_dict()
    assert {key: found[key] for key in ("mass", "com", "inertia")} == {
        key: alone[key] for key in ("mass", "com", "inertia")
    }
    assert found["provenance"]["files"][0]["name"] == "monday.parquet"
    assert json.loads((out / "diagnosis.json").read_text())["verdict"] == "consistent"
    assert not (out / "calibration").exists()
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "Diagnosis" in page
    assert "Estimate" in page
    assert "is an earlier result of watch; give --force" in refused(capsys, "watch", trial, "--out", out)


def test_robots_that_contradict_each_other_are_calibrated(tmp_path, capsys, no_diagnosis):
    """And the diagnosis is told of it; a sensor that is far off is named."""
    bias = mocobot.make_effect("sea_bias", {"bias_Nm": 0.15}, robot=3, joint=2)
    for k, kind in enumerate(("random", "periodic")):
        length = {"vias": 9} if k == 0 else {"duration_s": 6.0}
        mocobot.simulate("b", kind, seed=2, effects=[bias], **length).write(tmp_path / f"{kind}.parquet")
    files, out = [tmp_path / "random.parquet", tmp_path / "periodic.parquet"], tmp_path / "seen"
    code, said, err = run(capsys, "watch", *files, "--out", out, "--strict")
    text = " ".join(said.split())
    assert "as designed they contradict each other; they were calibrated on these recordings" in text
    assert "Farther off than robots are: robot 3, torque zero 2: 1" in text
    assert "No diagnosis: there are too few of them." in text
    assert code == 1, "without a diagnosis nothing is understood"
    assert err.startswith("mocobot: ")
    (asked,) = no_diagnosis
    zero = asked["calibration"].units.of("tau_zero")[2, 1]
    assert zero == pytest.approx(0.15, abs=4 * asked["calibration"].sd[2, 19])
    assert json.loads((out / "estimate.json").read_text())["method"] == "calibrated"
    assert mocobot.read_calibration(out).units.of("tau_zero")[2, 1] == zero
    assert (out / "calibration" / "model" / "team.xml").is_file()
    assert (out / "report.html").read_text() == "the page"


def test_a_log_is_converted_and_one_of_no_use_left_out(trial, tmp_path, capsys, no_diagnosis):
    log, brief, out = tmp_path / "log.csv", tmp_path / "brief.parquet", tmp_path / "seen"
    write_text(log, read_recording(trial).columns())
    write_recording(small_recording(rows=150), brief)
    code, said, _ = run(capsys, "watch", log, brief, "--out", out)
    assert code == 0
    assert (
        f"{log}: ready for: grasps yes, mass yes, centre of mass yes, inertia yes (converted)."
        in " ".join(said.split())
    )
    assert f"{brief}: left out, ready for: nothing (" in " ".join(said.split())
    kept = read_recording(out / "recordings" / "log.parquet")
    assert len(no_diagnosis[0]["recordings"]) == 1
    assert kept.time[-1] == pytest.approx(read_recording(trial).time[-1], abs=0.02)
    assert (out / "verdict.txt").read_text().splitlines()[0].startswith(f"{log}: ready")


def test_nothing_of_use(tmp_path, capsys):
    brief = tmp_path / "brief.parquet"
    write_recording(small_recording(rows=150), brief)
    code, said, _ = run(capsys, "watch", brief)
    assert code == 0
    assert said.splitlines()[-1].startswith("Nothing can be estimated")
    assert run(capsys, "watch", brief, "--strict")[0] == 1


def test_the_page_is_opened(trial, capsys, monkeypatch, no_diagnosis):
    opened: list[str] = []
    monkeypatch.setattr(commands.webbrowser, "open", opened.append)
    run(capsys, "watch", trial, "--open")
    (address,) = opened
    assert address.startswith("file:///")
    assert Path(address.removeprefix("file://")).is_file()


def test_a_log_with_a_hole_is_cut_and_one_that_cannot_be_used_left_out(trial, tmp_path, capsys, no_diagnosis):
    """One hole or one stamp that runs back had ended the command for all files."""
    columns, out = read_recording(trial).columns(), tmp_path / "seen"
    time = columns["time"]
    hole, back = tmp_path / "hole.csv", tmp_path / "back.csv"
    write_text(hole, {name: x[(time < 2.0) | (time > 2.5)] for name, x in columns.items()})
    time = time.copy()
    time[500] -= 0.015
    write_text(back, columns | {"time": time})
    code, said, _ = run(capsys, "watch", hole, back, "--out", out)
    text = " ".join(said.split())
    assert code == 0
    assert (
        f"{hole}: ready for: grasps yes, mass yes, centre of mass yes, inertia yes (the part of it between"
        in text
    )
    assert (
        f"{back}: left out, it cannot be used as it is: {back}: robot 1: time runs back by 0.005 s in row"
        in text
    )
    assert "Payload: 11.6" in text
    assert len(no_diagnosis[0]["recordings"]) == 1
    kept = read_recording(out / "recordings" / "hole.part1.parquet")
    assert kept.time[-1] - kept.time[0] == pytest.approx(time[-1] - 2.51, abs=0.02)
