"""``mocobot diagnose`` as a user meets it: what it says and writes, and what it refuses."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import mujoco
import numpy as np
import pytest

from diagnose_run import (
    BIAS_NM,
    changed,
    of_longer_links,
    refused,
    run,
    unlabelled_and_heavier,
    with_metadata,
    without_robots,
)
from diagnosed import check_schema
from discrepancy.result.traces import load_traces
from estimator.files import holds
from mocobot_sim.extended.extended import load_extended


@pytest.mark.slow
@pytest.mark.pictures
def test_hidden_bias_is_named_extended_and_written(biased_trials, tmp_path, capsys):
    out = tmp_path / "verdict"
    out.mkdir()  # an empty folder may be used
    code, text, _ = run(capsys, *biased_trials, "--out", out, "--jobs", 1, "--pictures")
    values = json.loads((out / "diagnosis.json").read_text())
    check_schema(values)
    assert code == 0
    assert text.startswith("EXPLAINED: one finding accounts for what the model gets wrong")
    assert "torque zero of joint 1 of robot 2" in " ".join(text.split())
    lines = [line for line in text.splitlines() if "Written" not in line and "    mocobot " not in line]
    assert max(map(len, lines)) <= 100
    report = (out / "report.txt").read_text()
    assert "Robot 2, joint 1: the torque sensor reads 0.0" in report
    assert text.splitlines()[0] == report.splitlines()[0]

    assert values["verdict"] == "explained"
    cause = values["causes"][0]
    assert (cause["cause"], cause["robot"], cause["joint"]) == ("sea_bias", 2, 1)
    assert cause["parameters"]["bias_Nm"]["value"] == pytest.approx(BIAS_NM, rel=0.1)
    assert cause["explained"]["held_out"] > 0.8
    gain = values["gain"]
    assert gain["validated"]
    assert gain["held_out"]["after"]["chi2_per_n"] < 0.1 * gain["held_out"]["before"]["chi2_per_n"]
    assert gain["errors"]["after"]["mass_percent"] < 0.2 * gain["errors"]["before"]["mass_percent"]
    assert gain["estimates"]["after"]["mass_kg"] == pytest.approx(11.672, rel=1e-3)

    pictures = {path.name for path in out.glob("*.png")}
    assert pictures == {
        "residual_trial1.png", "residual_trial2.png", "residual_against.png", "evidence.png", "closed_loop.png"
    }  # fmt: skip
    assert load_extended(out / "extended").units[1].tau_zero_Nm[0] == pytest.approx(BIAS_NM, rel=0.1)
    mujoco.MjModel.from_xml_path(str(out / "extended" / "team.xml"))
    assert [path.name for path in tmp_path.iterdir()] == ["verdict"]

    made = values["provenance"]
    assert (made["command"], made["options"]["closed_loop"]) == ("diagnose", True)
    truths = [path.with_suffix("").with_suffix(".truth.json") for path in biased_trials]
    assert [entry["path"] for entry in made["files"]] == [str(path) for path in (*biased_trials, *truths)]
    for entry in made["files"]:
        assert entry["sha256"] == hashlib.sha256(Path(entry["path"]).read_bytes()).hexdigest()

    traces, channels = load_traces(out / "residuals.npz")
    assert [trace.name for trace in traces] == values["recordings"]
    assert [channel.name for channel in channels[-3:]] == ["moment x", "moment y", "moment z"]
    chi2 = sum(np.sum(trace.white_before**2) for trace in traces)
    samples = sum(trace.white_before.size for trace in traces)
    assert chi2 / samples == pytest.approx(values["residual"]["nominal"]["chi2_per_n"], rel=0.01)
    assert sum(np.sum(trace.white_after**2) for trace in traces) < 0.1 * chi2
    assert holds("diagnosis")(out)

    # Its own result may be replaced, but nothing that someone put there is lost.
    (out / "notes.txt").write_text("mine")
    assert "notes.txt: was not written by mocobot" in refused(capsys, *biased_trials, "--out", out)
    assert (out / "notes.txt").read_text() == "mine"


@pytest.mark.slow
def test_one_trial_without_commands_says_what_stays_open(edited, tmp_path, capsys):
    bare = edited(
        "bare.parquet", lambda t: t.drop_columns([name for name in t.column_names if ".ref_" in name])
    )
    out = tmp_path / "verdict"
    code, text, _ = run(capsys, bare, "--out", out, "--jobs", 1, "--verbose")
    values, words = json.loads((out / "diagnosis.json").read_text()), " ".join(text.split())
    check_schema(values, simulated=False)
    assert code == 0
    assert "There is one trial only, so the findings are not tested on data left out of the fit." in words
    assert "The closed loop was not simulated: " in words
    assert "has no commands (ref_x, ref_y, ref_z)" in values["not_simulated"]
    assert values["gain"]["held_out"] == {"before": None, "after": None, "as_found": None}
    assert "errors" not in values["gain"]
    assert not (out / "closed_loop.png").exists()


@pytest.mark.slow
def test_excluded_cause_is_not_named(biased_trials, capsys):
    code, text, _ = run(
        capsys, biased_trials[0], "--no-closed-loop", "--jobs", 1, "--exclude", "sea_bias", "joint_friction"
    )
    assert code == 0
    assert "torque zero" not in text


def test_nothing_is_left_when_interrupted(biased_trials, tmp_path, capsys, monkeypatch):
    def stop(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("discrepancy.team.diagnosis.estimate_payload", stop)
    code, out, err = run(capsys, *biased_trials, "--out", tmp_path / "verdict")
    assert (code, out) == (130, "")
    assert err.endswith("mocobot: interrupted")
    assert not list(tmp_path.iterdir())


def still(v: np.ndarray) -> np.ndarray:
    """A channel at its first value, with enough noise that no row repeats another."""
    return v[0] + 1e-6 * np.cos(np.arange(len(v)))


@pytest.mark.parametrize(
    ("name", "edit", "words"),
    [
        ("two.parquet", without_robots(2), ["two.parquet", "is a robot missing"]),
        ("one.parquet", without_robots(1), ["one.parquet has one robot"]),
        ("still.parquet", changed("omnid", still), ["do not determine the grasps"]),
        ("short.parquet", lambda t: t.slice(0, 100), ["short.parquet", "0.0 s are left"]),
        ("brief.parquet", lambda t: t.slice(0, 600), ["brief.parquet", "2.0 s are left", "at least 5 s"]),
    ],
)
def test_bad_recording_is_refused(edited, tmp_path, capsys, name, edit, words):
    message = refused(capsys, edited(name, edit), "--out", tmp_path / "verdict", "--jobs", 1)
    for word in words:
        assert word in message
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("name", "edit", "words"),
    [
        ("c.parquet", with_metadata(payload="c"), ["'c'", "'b'"]),
        ("heavy.parquet", unlabelled_and_heavier, ["heavy.parquet says 1", "kg", "of one payload"]),
        ("pair.parquet", without_robots(2), ["has 2 robots", "has 3"]),
        ("links.parquet", of_longer_links, ["links.parquet", "different design"]),
    ],
)
def test_recordings_that_do_not_belong_together(biased_trials, edited, capsys, name, edit, words):
    message = refused(capsys, biased_trials[1], edited(name, edit))
    for word in words:
        assert word in message


@pytest.mark.parametrize("odds", ["0", "-1", "1e4"])
def test_odds_that_are_none_are_refused(tmp_path, capsys, odds):
    message = refused(capsys, tmp_path / "none.parquet", "--odds", odds)
    assert f"odds is {float(odds):g}; it must be greater than 0 and at most 1000" in message


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[sea_bias", ["not a readable file of tolerances"]),
        ("[ghost]\na = 1\n", ["unknown table 'ghost'", "sea_bias"]),
        ("[sea_bias]\nbias = 1\n", ["has no 'bias'", "bias_Nm"]),
        ("[sea_bias]\nbias_Nm = -1\n", ["sea_bias.bias_Nm is -1"]),
        ("[sea_bias]\nbias_Nm = 'much'\n", ["'much'"]),
    ],
)
def test_bad_tolerances_are_refused(biased_trials, tmp_path, capsys, text, words):
    path = tmp_path / "tolerances.toml"
    path.write_text(text)
    message = refused(capsys, *biased_trials, "--tolerances", path)
    for word in ["tolerances.toml", *words]:
        assert word in message
