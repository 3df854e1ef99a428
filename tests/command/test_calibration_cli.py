"""``--calibration`` of estimate, inspect, diagnose and replay, and ``estimate --self-calibrate``."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import mocobot
from command import refused, run
from estimator.calibrate.calibrate import calibrate
from estimator.recording.parquet import read_recording, write_recording
from invented_calibration import invented_calibration
from mocobot.api.calibration import read_calibration, write_calibration
from mocobot_report.blocks.html import words
from mocobot_report.estimate.part import answer
from mocobot_report.folder import Estimated
from recorded_team import COM, MASS
from recordings import small_recording
from uncalibrated_team import DEFAULT, uncalibrated


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two recordings of a team that is not as designed, and its calibration."""
    folder = tmp_path_factory.mktemp("calibrated")
    recordings = []
    for name, seed in (("one", 4), ("two", 5)):
        recording = replace(uncalibrated(seed=seed, without=DEFAULT)[0].recording, name=name)
        recordings.append(recording)
        write_recording(recording, folder / f"{name}.parquet")
    write_calibration(folder / "calibration.json", calibrate(recordings))
    write_calibration(folder / "two_robots.json", invented_calibration(2))
    return folder


def test_estimate(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    one, calibration, target = folder / "one.parquet", folder / "calibration.json", tmp_path / "est.json"
    code, out, err = run(capsys, "estimate", one, "--calibration", calibration, "--out", target)
    assert (code, err) == (0, "")
    assert "3 calibrated robots, " in out
    assert "contradict" not in out
    written = json.loads(target.read_text(encoding="utf-8"))
    assert written["contradicts"] is False
    assert written["mass"]["m_kg"] == pytest.approx(MASS, rel=3e-3)
    assert len(written["calibrated"]["units"]) == 3
    files = [file["name"] for file in written["provenance"]["files"]]
    assert files == ["one.parquet", "calibration.json"]
    again = mocobot.read_estimate(target)
    np.testing.assert_array_equal(again.units.x, read_calibration(calibration).units.x)  # type: ignore[union-attr]
    plain = mocobot.estimate(one)
    assert plain.contradicts is True
    assert "calibrated" not in plain.to_dict()


def test_self_calibrate(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files, target = (folder / "one.parquet", folder / "two.parquet"), tmp_path / "est.json"
    code, out, _ = run(capsys, "estimate", *files, "--self-calibrate", "--out", target)
    assert code == 0
    assert "self-calibrated estimate" in out
    found = mocobot.read_estimate(target)
    assert found.method == "calibrated"
    assert found.p_1c == pytest.approx(COM, abs=3e-4)
    told = words(answer(Estimated(target, found, None))[0])
    assert "in one least squares with the robots' own calibration" in told


def test_inspect(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    one, target = folder / "one.parquet", tmp_path / "log.json"
    code, out, _ = run(capsys, "inspect", one, "--calibration", folder / "calibration.json", "--json", target)
    assert code == 0
    assert "the robots are taken as a calibration has them" in out
    found = json.loads(target.read_text(encoding="utf-8"))
    assert found["log"]["calibrated"] is True
    assert found["wiring"]["misfit"]["total"] < 1e-3  # 0.1 and more for the same robots as designed


def test_metadata_can_carry_it(folder: Path, tmp_path: Path) -> None:
    """A recording that says what its robots are needs no option."""
    recording, made = read_recording(folder / "one.parquet"), read_calibration(folder)
    known = replace(recording, metadata=replace(recording.metadata, units=made.units))
    write_recording(known, tmp_path / "known.parquet")
    found = mocobot.estimate(tmp_path / "known.parquet", method="joint")
    assert found.contradicts is False
    assert found.mass is not None
    given = mocobot.estimate(recording, calibration=made, method="joint")
    assert given.mass is not None
    assert found.mass.mass == given.mass.mass


@pytest.mark.parametrize("command", ["estimate", "inspect", "diagnose", "replay"])
def test_a_calibration_of_other_robots_is_refused(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    given = [folder / "one.parquet", "--calibration", folder / "two_robots.json"]
    more = ["--save", tmp_path / "out.rrd"] if command == "replay" else []
    sentence = refused(capsys, command, *given, *more)
    assert "two_robots.json is of 2 robots and " in sentence
    assert "one.parquet of 3 robots; a calibration is for the robots it was made with" in sentence


def test_what_cannot_be_is_refused(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    one, calibration = folder / "one.parquet", folder / "calibration.json"
    assert "--self-calibrate and --calibration are both given; choose one" in refused(
        capsys, "estimate", one, "--calibration", calibration, "--self-calibrate"
    )
    assert "--self-calibrate and --method are both given" in refused(
        capsys, "estimate", one, "--self-calibrate", "--method", "joint"
    )
    assert "none.json: there is no such file; it would be a calibration" in refused(
        capsys, "estimate", one, "--calibration", tmp_path / "none.json"
    )
    assert "calibration.json: is an input; write somewhere else" in refused(
        capsys, "estimate", one, "--calibration", calibration, "--out", calibration, "--force"
    )
    write_recording(small_recording(payload="a"), tmp_path / "a.parquet")
    assert "of payload None and" in refused(
        capsys, "estimate", tmp_path / "a.parquet", one, "--self-calibrate"
    )
