"""A team that calibrates itself: its payload is told, compared and scored in the frames that the encoders define."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import mocobot
from command import run
from discrepancy.team.estimates import errors, seen_by
from estimator.arm.unit import COUNT
from estimator.calibrate.json import calibration_to_dict
from estimator.recording.parquet import write_recording
from invented_calibration import invented_calibration
from mocobot.api.calibration import Calibration
from mocobot.commands.watch import _payload
from mocobot_report.estimate.part import answer
from mocobot_report.folder import Estimated
from mocobot_view.payload import read_truth
from recorded_team import COM, GRASPS, INERTIA, MASS
from uncalibrated_team import DEFAULT, uncalibrated

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
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two trials with the truth beside each."""
    folder = tmp_path_factory.mktemp("frames")
    for seed in (4, 5):
        recording = uncalibrated(seed=seed, without=DEFAULT)[0].recording
        read = recording.theta + np.multiply.outer(ZEROS, [0.0, 0.0, 1.0])
        write_recording(replace(recording, theta=read), folder / f"{seed}.parquet")
        (folder / f"{seed}.truth.json").write_text(json.dumps(truth()))
    return folder


@pytest.fixture(scope="module")
def found(folder: Path) -> mocobot.Estimate:
    return mocobot.estimate(sorted(folder.glob("*.parquet")), self_calibrate=True)


def test_numbers_are_right_in_the_frames_that_are_said(folder: Path, found: mocobot.Estimate) -> None:
    seen, drawn = read_truth(folder / "4.parquet", 3, found), read_truth(folder / "4.parquet", 3)
    assert seen.grasps is not None
    assert found.grasps is not None
    np.testing.assert_allclose(found.grasps.p_1i, seen.grasps.p_1i, atol=2e-4)
    np.testing.assert_allclose(found.grasps.R_1i, seen.grasps.R_1i, atol=2e-5)
    np.testing.assert_allclose(found.p_1c, seen.p_1c, atol=3e-4)
    np.testing.assert_allclose(drawn.p_1c, COM, atol=1e-12)
    assert np.abs(found.p_1c - drawn.p_1c).max() > 10 * found.p_1c_se_m.max()
    axes = seen.R_1c @ np.diag(seen.principal_kgm2) @ seen.R_1c.T
    np.testing.assert_allclose(found.inertia.inertia, axes, atol=0.02)


def test_text_json_page_notebook_and_first_look_say_which_frames(
    folder: Path, found: mocobot.Estimate, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    target, files = tmp_path / "est.json", sorted(folder.glob("*.parquet"))
    code, out, _ = run(capsys, "estimate", *files, "--self-calibrate", "--out", target)
    assert code == 0
    assert SAID + " +- 1 deg, which is not in the standard errors)" in out.splitlines()[1]
    assert json.loads(target.read_text())["frames"] == {
        "defined_by": "encoders", "theta_x_zero_sd_deg": pytest.approx(1.0)
    }  # fmt: skip
    again = mocobot.read_estimate(target)
    assert again.zero_sd_rad == pytest.approx(np.deg2rad(1.0))
    page = "".join(answer(Estimated(target, again, None))[0].itertext())
    for text in (page, again._repr_html_(), _payload(again)):
        assert SAID in text
    plain = mocobot.estimate(files[0])
    assert "frames" not in plain.to_dict()
    assert "encoders define" not in f"{plain} {plain._repr_html_()} {_payload(plain)}"


def test_frames_of_a_calibration() -> None:
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


def test_different_frames_are_not_compared(found: mocobot.Estimate) -> None:
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


def test_errors_of_a_diagnosis_are_in_its_frames() -> None:
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
