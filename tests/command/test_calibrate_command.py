"""``mocobot calibrate``, and calibrations in other commands: numbers, frames, and what is refused."""

from __future__ import annotations

import html
import json
import re
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import mocobot
from command import refused, run
from discrepancy.team.estimates import errors, seen_by
from estimator.arm.unit import COUNT
from estimator.calibrate.calibrate import calibrate
from estimator.calibrate.json import calibration_to_dict
from estimator.files import LIST, write_json
from estimator.recording.parquet import read_recording, write_recording
from invented_calibration import invented_calibration
from mocobot.api.calibration import Calibration, read_calibration
from mocobot.api.watch import payload_line as _payload
from mocobot.cli import main
from mocobot_report.page import write_report
from mocobot_sim.extended.extended import load_extended
from mocobot_view.payload import read_truth
from recorded_team import COM, GRASPS, INERTIA, MASS
from recordings import small_recording
from uncalibrated_team import DEFAULT, uncalibrated

TRIALS = {"swing": ("random", "--vias", "8"), "turn": ("periodic", "--duration", "6")}


@pytest.fixture(scope="module")
def trials(tmp_path_factory) -> list[Path]:
    """Two trials of a team out of the box, written by the command itself."""
    folder = tmp_path_factory.mktemp("trials")
    for name, (kind, *more) in TRIALS.items():
        path = folder / f"{name}.parquet"
        main(["simulate", "--payload", "b", "--preset", "uncalibrated", "--seed", "3", "--trajectory", kind, *more,
              "--out", str(path)])  # fmt: skip
    return [folder / f"{name}.parquet" for name in TRIALS]


@pytest.fixture(scope="module")
def calibrated(trials, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("calibrated") / "calibration"
    main(["calibrate", *map(str, trials), "--parallel-flanges", "--pictures", "--out", str(folder)])
    return folder


@pytest.mark.pictures
def test_a_team_out_of_the_box_is_found(calibrated, trials):
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


def test_folder_holds_what_is_promised(calibrated, trials):
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


def test_report_says_it_all(trials, calibrated, capsys, tmp_path):
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


def test_an_encoder_that_slipped_is_a_finding(trials, tmp_path, capsys):
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
def test_what_cannot_be_meant(trials, capsys, monkeypatch, tmp_path, more, said):
    monkeypatch.chdir(trials[0].parent)
    out = tmp_path / "out"
    assert said in refused(capsys, "calibrate", trials[0].name, trials[1].name, *more, "--out", out)
    assert not out.exists()


def test_no_recording_and_only_free_ones(capsys):
    assert "no recording with a payload is given" in refused(capsys, "calibrate")
    assert "no recording with a payload is given" in refused(capsys, "calibrate", "--free", "a.parquet")


def test_what_was_given_twice(trials, capsys):
    assert "is given twice" in refused(capsys, "calibrate", trials[0], trials[0])
    assert "is given twice" in refused(capsys, "calibrate", *trials, "--free", trials[0])


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """Two recordings of a team that is not as designed, and its calibration."""
    folder = tmp_path_factory.mktemp("calibrated")
    recordings = []
    for name, seed in (("one", 4), ("two", 5)):
        recording = replace(uncalibrated(seed=seed, without=DEFAULT)[0].recording, name=name)
        recordings.append(recording)
        write_recording(recording, folder / f"{name}.parquet")
    write_json(folder / "calibration.json", calibration_to_dict(calibrate(recordings)))
    write_json(folder / "two_robots.json", calibration_to_dict(invented_calibration(2)))
    return folder


def test_estimate_with_a_calibration(folder, tmp_path, capsys):
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


def test_self_calibrate(folder, tmp_path, capsys):
    files, target = (folder / "one.parquet", folder / "two.parquet"), tmp_path / "est.json"
    code, out, _ = run(capsys, "estimate", *files, "--self-calibrate", "--out", target)
    assert code == 0
    assert "self-calibrated estimate" in out
    found = mocobot.read_estimate(target)
    assert found.method == "calibrated"
    assert found.p_1c == pytest.approx(COM, abs=3e-4)
    told = html.unescape(write_report(tmp_path).read_text(encoding="utf-8"))
    assert "in one least squares with the robots' own calibration" in told


def test_inspect_with_a_calibration(folder, tmp_path, capsys):
    one, target = folder / "one.parquet", tmp_path / "log.json"
    code, out, _ = run(capsys, "inspect", one, "--calibration", folder / "calibration.json", "--json", target)
    assert code == 0
    assert "the robots are taken as a calibration has them" in out
    found = json.loads(target.read_text(encoding="utf-8"))
    assert found["log"]["calibrated"] is True
    assert found["wiring"]["misfit"]["total"] < 1e-3  # 0.1 and more for the same robots as designed


def test_metadata_can_carry_it(folder, tmp_path):
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
def test_a_calibration_of_other_robots_is_refused(folder, tmp_path, capsys, command):
    given = [folder / "one.parquet", "--calibration", folder / "two_robots.json"]
    more = ["--save", tmp_path / "out.rrd"] if command == "replay" else []
    sentence = refused(capsys, command, *given, *more)
    assert "two_robots.json is of 2 robots and " in sentence
    assert "one.parquet of 3 robots; a calibration is for the robots it was made with" in sentence


def test_what_cannot_be_is_refused(folder, tmp_path, capsys):
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


ZEROS = np.deg2rad([1.5, -1.0, 0.8])
"""What theta_x of every robot reads too much; nothing that the team carries shows it."""
SAID = "as the encoders define them: each turned about its x axis by the zero of that theta_x (0"


def truth() -> dict:
    """As it stands beside a simulated recording, in the frames of the drawing."""
    moments, axes = np.linalg.eigh(INERTIA)
    axes *= np.sign(np.linalg.det(axes))
    turns = [
        Rotation.from_matrix(R).as_rotvec(degrees=True).tolist() for R in (axes, *(R for R, _ in GRASPS))
    ]
    return {
        "mass_kg": MASS, "p_1c_m": COM.tolist(), "R_1c_rotvec_deg": turns[0],
        "principal_inertia_kgm2": moments.tolist(),
        "grasps": [
            {"R_1i_rotvec_deg": turn, "p_1i_m": p.tolist()} for turn, (_, p) in zip(turns[1:], GRASPS, strict=True)
        ],
        "as_built": [{"theta_zero_rad": [0.0, 0.0, zero]} for zero in ZEROS],
    }  # fmt: skip


@pytest.fixture(scope="module")
def turned(tmp_path_factory) -> Path:
    """Two trials with the truth beside each."""
    turned = tmp_path_factory.mktemp("frames")
    for seed in (4, 5):
        recording = uncalibrated(seed=seed, without=DEFAULT)[0].recording
        read = recording.theta + np.multiply.outer(ZEROS, [0.0, 0.0, 1.0])
        write_recording(replace(recording, theta=read), turned / f"{seed}.parquet")
        (turned / f"{seed}.truth.json").write_text(json.dumps(truth()))
    return turned


@pytest.fixture(scope="module")
def found(turned) -> mocobot.Estimate:
    return mocobot.estimate(sorted(turned.glob("*.parquet")), self_calibrate=True)


def test_numbers_are_right_in_the_frames_that_are_said(turned, found):
    seen, drawn = read_truth(turned / "4.parquet", 3, found), read_truth(turned / "4.parquet", 3)
    assert seen.grasps is not None
    assert found.grasps is not None
    np.testing.assert_allclose(found.grasps.p_1i, seen.grasps.p_1i, atol=2e-4)
    np.testing.assert_allclose(found.grasps.R_1i, seen.grasps.R_1i, atol=2e-5)
    np.testing.assert_allclose(found.p_1c, seen.p_1c, atol=3e-4)
    np.testing.assert_allclose(drawn.p_1c, COM, atol=1e-12)
    assert np.abs(found.p_1c - drawn.p_1c).max() > 10 * found.p_1c_se_m.max()
    axes = seen.R_1c @ np.diag(seen.principal_kgm2) @ seen.R_1c.T
    np.testing.assert_allclose(found.inertia.inertia, axes, atol=0.02)


def test_text_json_page_notebook_and_first_look_say_which_frames(turned, found, tmp_path, capsys):
    target, files = tmp_path / "est.json", sorted(turned.glob("*.parquet"))
    code, out, _ = run(capsys, "estimate", *files, "--self-calibrate", "--out", target)
    assert code == 0
    assert SAID + " +- 1 deg, which is not in the standard errors)" in out.splitlines()[1]
    assert json.loads(target.read_text())["frames"] == {
        "defined_by": "encoders", "theta_x_zero_sd_deg": pytest.approx(1.0)
    }  # fmt: skip
    again = mocobot.read_estimate(target)
    assert again.zero_sd_rad == pytest.approx(np.deg2rad(1.0))
    page = html.unescape(write_report(tmp_path).read_text(encoding="utf-8"))
    for text in (page, again._repr_html_(), _payload(again)):
        assert SAID in text
    plain = mocobot.estimate(files[0])
    assert "frames" not in plain.to_dict()
    assert "encoders define" not in f"{plain} {plain._repr_html_()} {_payload(plain)}"


def test_frames_of_a_calibration():
    made = invented_calibration(3)
    assert calibration_to_dict(made)["frames"] == {
        "defined_by": "encoders", "theta_x_zero_sd_deg": pytest.approx(1.0)
    }  # fmt: skip
    assert calibration_to_dict(_drawn(made))["frames"] == {
        "defined_by": "drawing",
        "theta_x_zero_sd_deg": 0.0,
    }


def _drawn(made: Calibration) -> Calibration:
    """The same with zeros of theta_x, as parallel flanges decide them."""
    x = made.units.x.copy()
    x[:, 5] = ZEROS
    assert x.shape == (3, COUNT)
    return replace(made, units=replace(made.units, x=x))


def test_different_frames_are_not_compared(found):
    made = Calibration(**vars(invented_calibration(3)))
    for one in (found, made):
        other = _drawn(one) if one is made else replace(one, units=_drawn(made).units, zero_sd_rad=0.0)
        mixed, same = mocobot.compare(one, other), mocobot.compare(one, one)
        carried = [{group.name.replace("payload c, ", "") for group in each.groups} for each in (mixed, same)]
        assert not {"centre of mass", "inertia", "grasp of robot 2, position"} & carried[0]
        assert "mass" in carried[0]
        assert {"mass", "centre of mass", "inertia", "grasp of robot 2, position"} <= carried[1]
        assert any("of the payload, the mass alone is compared" in note for note in mixed.notes)
        assert not any("mass alone" in note for note in same.notes)


def test_errors_of_a_diagnosis_are_in_its_frames():
    designed, calibrated, drawn = (
        truth(),
        invented_calibration(3).units,
        _drawn(invented_calibration(3)).units,
    )
    turn = Rotation.from_euler("x", ZEROS[:, None]).as_matrix()
    back, turned = turn[0].T, [turn[0].T @ R @ own for own, (R, _) in zip(turn, GRASPS, strict=True)]
    turns = Rotation.from_matrix(turned).as_rotvec(degrees=True)
    grasps = [{"R_1i_rotvec_deg": r, "p_1i_m": back @ p} for r, (_, p) in zip(turns, GRASPS, strict=True)]
    estimate = designed | {"p_1c_m": back @ COM, "grasps": grasps}
    right = errors(estimate, seen_by(calibrated, designed))
    assert max(right.values()) < 1e-9
    for units in (drawn, None):
        assert errors(estimate, seen_by(units, designed))["grasp_position_mm"] > 3.0
