"""A recording of robots that hold nothing in every command: taken for what it tells, refused in one sentence else."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import command
import mocobot
from estimator.recording.parquet import read_recording, write_recording
from mocobot_view.payload import BodyFacts, Grasps
from mocobot_view.replay_trial import replay_trial
from mocobot_view.stream import summary

READY = "mocobot calibrate --free yes, an estimate no (the robots hold nothing)"


@pytest.fixture(scope="module")
def free(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("free") / "free.parquet"
    mocobot.simulate(trajectory="free", robots=2, vias=8, preset="uncalibrated", seed=3).write(path)
    return path


def test_simulate_writes_the_same_as_from_python(free, tmp_path, capsys):
    out = tmp_path / "again.parquet"
    arguments = ["--trajectory", "free", "--robots", 2, "--vias", 8, "--preset", "uncalibrated", "--seed", 3]
    code, said, _ = command.run(capsys, "simulate", *arguments, "--out", out)
    assert code == 0
    assert "s of free motion, uncalibrated sensors" in said
    assert out.read_bytes() == free.read_bytes()
    truth = json.loads(out.with_suffix(".truth.json").read_text())
    assert set(truth) == {"as_built", "effects", "control"}
    carrying = mocobot.simulate(vias=1, preset="uncalibrated", seed=3).truth.to_dict()
    assert truth["as_built"] == carrying["as_built"][:2], "one seed is one team"


def test_a_payload_says_how_many_robots_there_are(tmp_path, capsys):
    arguments = ["--trajectory", "free", "--payload", "a", "--robots", 3, "--out", tmp_path / "new.parquet"]
    sentence = "--payload and --robots are both given; a payload says how many robots there are"
    assert command.refused(capsys, "simulate", *arguments) == f"mocobot: {sentence}"


@pytest.mark.parametrize(("name", "done"), [("estimate", "estimated"), ("diagnose", "diagnosed")])
def test_nothing_comes_of_a_payload(free, capsys, name, done):
    assert command.refused(capsys, name, free) == (
        f"mocobot: {free}: trial is 'free': the robots hold nothing, so nothing can be {done}; "
        "mocobot calibrate --free takes it"
    )


def test_inspect_leaves_out_what_needs_a_payload(free, capsys):
    code, said, _ = command.run(capsys, "inspect", free, "--strict")
    assert code == 0
    assert (
        "the robots hold nothing: clocks, wiring and excitation, which need a payload that all of them"
        in said
    )
    assert "[[Wrong]]  nothing found" in said, "gimbals that stand are not stuck"
    assert said.rstrip().endswith(f"ready for: {READY}")
    assert "misfit" not in said
    found = mocobot.inspect(free)
    told = found.to_dict()
    assert told["log"]["free"] is True
    assert told["clocks"] is told["wiring"] is told["excitation"]["as_it_is"] is None
    assert told["segments"]["moving_s"] > 3.0


def test_inspect_still_looks_at_every_channel(free, tmp_path):
    recording = read_recording(free)
    phi = recording.phi.copy()
    phi[900:1000, 0, 1] = phi[900, 0, 1]  # in the midst of the haste
    write_recording(replace(recording, phi=phi), tmp_path / "stuck.parquet")
    found = mocobot.inspect(tmp_path / "stuck.parquet")
    assert ["omnid1.phi2 is stuck from 9.00 s" in f.sentence for f in found.findings] == [True]
    assert found.ready_for == (
        f"ready for: nothing as it is; with the 1 s left out in which omnid1.phi2 stands still: {READY}"
    )


@pytest.mark.parametrize("suffix", [".npz", ".mcap", ".csv"])
def test_convert_goes_round(free, tmp_path, capsys, suffix):
    there, back = tmp_path / f"log{suffix}", tmp_path / "back.parquet"
    said = command.run(capsys, "convert", free, there)[1]
    assert "robot 2: not determined, the robots hold nothing, so they do not move together" in said
    assert "2 robots, joint level, free trial" in said
    trial = ["--trial", "free"] if suffix == ".csv" else []  # text has no metadata
    assert command.run(capsys, "convert", there, back, *trial)[0] == 0
    one, other = read_recording(free), read_recording(back)
    assert (other.metadata.trial, other.metadata.payload) == ("free", None)
    np.testing.assert_allclose(other.tau, one.tau, rtol=0, atol=1e-12)
    for options, sentence in (
        (
            ["--payload", "a"],
            "payload is 'a', but in a free trial the robots hold nothing; leave the payload out",
        ),
        (
            ["--clock", "correct"],
            "the clock of robot 2 cannot be told from the motion and so not be corrected: the",
        ),
    ):
        target = tmp_path / "refused.parquet"
        assert sentence in command.refused(capsys, "convert", there, target, *trial, *options)
        assert not target.exists()


def test_a_map_may_say_that_the_robots_hold_nothing(free, tmp_path, capsys):
    log, log_map = tmp_path / "log.csv", tmp_path / "map.toml"
    command.run(capsys, "convert", free, log)
    command.run(capsys, "map", log, "--out", log_map)
    log_map.write_text(log_map.read_text().replace("version = 1", 'version = 1\ntrial = "free"', 1))
    assert mocobot.inspect(log, map=log_map).free
    assert not mocobot.inspect(log).free
    assert command.run(capsys, "inspect", log, "--map", log_map)[1].rstrip().endswith(f"ready for: {READY}")
    assert "the robots hold nothing" in command.refused(capsys, "estimate", log, "--map", log_map)


def test_replay_draws_the_robots_alone(free, tmp_path, capsys):
    code, said, _ = command.run(capsys, "replay", free, "--truth", "--save", tmp_path / "free.rrd")
    assert code == 0
    assert (
        "The robots hold nothing: they are drawn in a row, without a payload, an estimate or forces on one."
        in said
    )
    assert (tmp_path / "free.rrd").stat().st_size > 10_000
    true = BodyFacts(Grasps(np.eye(3)[None], np.zeros((1, 3))), 1.0, np.zeros(3), np.eye(3), np.ones(3))
    trial = replay_trial(read_recording(free), "free", truth=true)
    assert trial.estimate is trial.facts is trial.truth is trial.motion is trial.data is None
    assert len(trial.notes) == 1
    assert "Payload" not in summary(trial)
