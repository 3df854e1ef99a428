"""A recording of robots that hold nothing in every command: taken for what it tells, refused in one sentence else."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import command
import mocobot
from estimator.recording.parquet import read_recording
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
