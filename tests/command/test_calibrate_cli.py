"""``mocobot calibrate``: what it writes, what it says, and its exit code on bad input."""

from __future__ import annotations

import json
import re
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import mocobot
from command import refused, run
from estimator.files import LIST
from estimator.recording.parquet import read_recording, write_recording
from mocobot.cli import main
from mocobot_sim.extended.extended import load_extended

TRIALS = {"swing": ("random", "--vias", "8"), "turn": ("periodic", "--duration", "6")}


@pytest.fixture(scope="module")
def trials(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Two trials of a team out of the box, written by the command itself."""
    folder = tmp_path_factory.mktemp("trials")
    for name, (kind, *more) in TRIALS.items():
        path = folder / f"{name}.parquet"
        main(["simulate", "--payload", "b", "--preset", "uncalibrated", "--seed", "3", "--trajectory", kind, *more,
              "--out", str(path)])  # fmt: skip
    return [folder / f"{name}.parquet" for name in TRIALS]


@pytest.fixture(scope="module")
def calibrated(trials: list[Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("calibrated") / "calibration"
    main(["calibrate", *map(str, trials), "--parallel-flanges", "--pictures", "--out", str(folder)])
    return folder


def test_a_team_out_of_the_box_is_found(calibrated: Path, trials: list[Path]) -> None:
    found = mocobot.read_calibration(calibrated)
    truth = json.loads(trials[0].with_suffix(".truth.json").read_text(encoding="utf-8"))
    zeros = np.array([unit["theta_zero_rad"] for unit in truth["as_built"]])
    np.testing.assert_allclose(found.units.of("theta_zero"), zeros, atol=2e-4)
    np.testing.assert_allclose(found.payloads[0].parameters[0], truth["mass_kg"], rtol=0.03)
    p = np.array([grasp["p_1i_m"] for grasp in truth["grasps"]])
    np.testing.assert_allclose(found.payloads[0].grasps.p_1i, p, atol=3e-3)
    for trial in found.trials:
        assert trial.before is not None
        assert min(trial.before) > 100 > 2.0 > max(trial.after)
        assert trial.held_out is not None


def test_folder_holds_what_is_promised(calibrated: Path, trials: list[Path]) -> None:
    assert sorted(path.name for path in calibrated.iterdir()) == [
        LIST, "calibration.json", "deviations.png", "model", "omnid1.toml", "omnid2.toml", "omnid3.toml",
        "recordings.png", "report.txt", "shares.png",
    ]  # fmt: skip
    values = json.loads((calibrated / "calibration.json").read_text(encoding="utf-8"))
    assert values["format"] == "mocobot-calibration"
    made = values["provenance"]
    assert made["command"] == "calibrate"
    assert made["options"]["parallel_flanges"] is True
    assert [entry["name"] for entry in made["files"]] == [path.name for path in trials]
    found = mocobot.read_calibration(calibrated / "calibration.json")
    second = tomllib.loads((calibrated / "omnid2.toml").read_text(encoding="utf-8"))
    assert second["rod_length_m"] == pytest.approx(list(np.ravel(found.units.rod_length_m[1])))
    assert second["theta_zero_rad"] == values["deviations"][1]["theta_zero_rad"]["value"]
    assert second["sea_stiffness_Nm_per_rad"][2] == pytest.approx(
        found.design.sea_stiffness_Nm_per_rad * (1 + values["deviations"][1]["stiffness_ratio"]["value"][2])
    )
    scene = load_extended(calibrated / "model")
    np.testing.assert_array_equal(scene.units[0].tau_zero_Nm, found.units.of("tau_zero")[0])
    for name in ("deviations.png", "recordings.png", "shares.png"):
        assert (calibrated / name).read_bytes().startswith(b"\x89PNG")


def test_report_says_it_all(
    trials: list[Path], calibrated: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """A second payload by --payload-of would have no grasps of its own; the same label twice is one payload."""
    labels = f"{trials[0].name}=box", f"{trials[1]}=box"
    code, out, err = run(capsys, "calibrate", *trials, "--tilt", "--known-mass", "10.48+-0.01", "--strict",
                         "--payload-of", *labels, "--out", tmp_path / "new" / "it")  # fmt: skip
    assert (code, err) == (0, "")
    assert "Calibration]]  3 robots, 2 recordings" in out
    for said in ("[[Robot 3]]", "encoder zero phi [deg]", "base tilt [deg]", "[[All arms together]]",
                 "[[Payload (box)]]", "as designed", "left out", "swing.parquet", "[[What stays open]]",
                 "x: held"):  # fmt: skip
        assert said in out, said
    mass = re.search(r"mass \[kg\] +([\d.]+) \+- ([\d.]+)", out)
    assert mass is not None
    assert float(mass[1]) == pytest.approx(10.48, abs=0.03)
    assert "common scale, which is held" not in out  # the weight decides it
    assert out.rstrip().endswith(f"Written to {tmp_path / 'new' / 'it'}.")
    assert (tmp_path / "new" / "it" / "report.txt").read_text(encoding="utf-8").strip() in out
    found = mocobot.read_calibration(tmp_path / "new" / "it")
    assert found.scale_sd == 0
    assert found.units.of("tilt").any()
    assert found.known_mass == ("box",)
    sentence = refused(capsys, "calibrate", *trials, "--out", calibrated)
    assert "is an earlier calibration; give --force to replace it" in sentence


def test_an_encoder_that_slipped_is_a_finding(
    trials: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    slipped = read_recording(trials[1])
    theta = slipped.theta.copy()
    theta[:, 1, 1] += np.deg2rad(1.5)
    write_recording(replace(slipped, theta=theta), tmp_path / "slipped.parquet")
    code, out, err = run(capsys, "calibrate", trials[0], tmp_path / "slipped.parquet", "--strict")
    assert code == 1
    assert "[[Findings]]" in out
    assert err.startswith("mocobot: the calibration is not to be trusted: ")


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["--known-mass", "heavy"], "--known-mass is 'heavy'; it must be [LABEL=]KG or [LABEL=]KG+-SE"),
        (["--known-mass", "b=10+-0"], "--known-mass is 'b=10+-0'; it must be"),
        (["--known-mass", "b=10", "b=11"], "--known-mass names payload 'b' twice"),
        (["--known-mass", "z=10"], "known mass of payload 'z'"),
        (["--payload-of", "nowhere.parquet=z"], "--payload-of is 'nowhere.parquet=z'; it must be REC=LABEL"),
        (["--payload-of", "swing.parquet="], "--payload-of is 'swing.parquet='; it must be REC=LABEL"),
        (["--payload-of", "swing.parquet=x", "swing.parquet=y"], "swing.parquet twice"),
        (["--prior", "none.toml"], "none.toml: not a readable prior of a calibration (No such file"),
        (["--map", "my.toml"], "my.toml"),
    ],
)
def test_what_cannot_be_meant(
    trials: list[Path], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path,
    more: list[str], said: str,
) -> None:  # fmt: skip
    monkeypatch.chdir(trials[0].parent)
    out = tmp_path / "out"
    assert said in refused(capsys, "calibrate", trials[0].name, trials[1].name, *more, "--out", out)
    assert not out.exists()


def test_no_recording_and_only_free_ones(capsys: pytest.CaptureFixture[str]) -> None:
    assert "no recording with a payload is given" in refused(capsys, "calibrate")
    assert "no recording with a payload is given" in refused(capsys, "calibrate", "--free", "a.parquet")


def test_what_was_given_twice(trials: list[Path], capsys: pytest.CaptureFixture[str]) -> None:
    assert "is given twice" in refused(capsys, "calibrate", trials[0], trials[0])
    assert "is given twice" in refused(capsys, "calibrate", *trials, "--free", trials[0])
