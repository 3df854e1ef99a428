"""A calibration as files and text, and in the frames of drawings."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimator.arm.unit import AT, COUNT, GROUPS
from estimator.arrays import Array
from estimator.calibrate.calibration import CalibratedPayload, Calibration, carried, grasps_of
from estimator.calibrate.flanges import in_drawing_frames, parallel_flanges, turned
from estimator.calibrate.json import calibration_from_dict, calibration_to_dict
from estimator.calibrate.prior import Prior
from estimator.calibrate.text import format_calibration, frames_sentence, shown_groups, unit_toml
from estimator.errors import InputError
from estimator.estimate.grasps import GraspEstimate
from estimator.files import write_json
from invented_calibration import invented_calibration
from mocobot.api.calibration import read_calibration
from mocobot_sim.scene.scene import build_team


def through_text(values: dict[str, Any]) -> dict[str, Any]:
    return json.loads(json.dumps(values, allow_nan=False))


@pytest.mark.parametrize("robots", [2, 3])
def test_what_is_written_is_read_back(robots: int) -> None:
    made = invented_calibration(robots)
    read = calibration_from_dict(through_text(calibration_to_dict(made)))
    assert read.design == made.design
    assert read.prior == made.prior
    for name in ("known_mass", "steps", "findings", "open", "scale_sd"):
        assert getattr(read, name) == getattr(made, name)
    np.testing.assert_array_equal(read.units.x, made.units.x)
    np.testing.assert_array_equal(read.covariance, made.covariance)
    np.testing.assert_array_equal(read.by_scale, made.by_scale)
    np.testing.assert_array_equal(read.sd, made.sd)
    for a, b in zip(read.payloads, made.payloads, strict=True):
        assert a.label == b.label
        for name in ("parameters", "covariance", "by_scale"):
            np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
        np.testing.assert_allclose(a.grasps.R_1i, b.grasps.R_1i, atol=1e-14)
        np.testing.assert_array_equal(a.grasps.p_1i, b.grasps.p_1i)
        np.testing.assert_array_equal(a.grasps.covariance, b.grasps.covariance)
    for a, b in zip(read.trials, made.trials, strict=True):
        for name in (
            "name",
            "kind",
            "payload",
            "duration_s",
            "count",
            "before",
            "after",
            "held_out",
            "shares",
        ):
            assert getattr(a, name) == getattr(b, name)
        assert (a.bases is None) == (b.bases is None)
        if a.bases is not None and b.bases is not None:
            np.testing.assert_allclose(a.bases.R, b.bases.R, atol=1e-14)
            np.testing.assert_array_equal(a.bases.p, b.bases.p)


def test_units_in_the_keys_and_errors_with_the_held_scale() -> None:
    made = invented_calibration(3)
    values = calibration_to_dict(made)
    spring = values["deviations"][1]["stiffness_ratio"]
    at = COUNT + AT["stiffness_ratio"].start
    expected = np.hypot(np.sqrt(made.covariance[at, at]), made.scale_sd * made.by_scale.ravel()[at])
    assert spring["se"][0] == pytest.approx(expected)
    assert spring["prior_se"][0] == pytest.approx(0.02 * np.sqrt(1 - 1 / 9))  # the mean of nine is held
    assert values["deviations"][0]["phi_zero_rad"]["value"] == list(made.units.of("phi_zero")[0])
    assert values["deviations"][0]["theta_zero_rad"]["prior_se"][2] == 0.0  # theta_x only turns the frames
    assert set(values["deviations"][0]) >= {"tau_zero_Nm", "radius_m", "tilt_rad", "wrist_mass_ratio"}
    assert "omnid1.theta_zerox" not in values["covariance"]["names"]
    free = next(trial for trial in values["trials"] if trial["kind"] == "free")
    assert free["chi2_per_n"] == {
        "before": None,
        "after": {"loops": None, "balance": free["chi2_per_n"]["after"]["balance"]},
        "held_out": None,
    }


def test_a_file_and_its_folder(tmp_path: Path) -> None:
    made = invented_calibration(2)
    path = tmp_path / "calibration.json"
    write_json(path, calibration_to_dict(made) | {"provenance": {"mocobot": "1"}})
    assert json.loads(path.read_text(encoding="utf-8"))["provenance"] == {"mocobot": "1"}
    for given in (path, tmp_path):
        np.testing.assert_array_equal(read_calibration(given).units.x, made.units.x)
    with pytest.raises(InputError, match=r"none\.json: there is no such file; it would be a calibration"):
        read_calibration(tmp_path / "none.json")


def changed(path: str, value: Any) -> Callable[[dict[str, Any]], None]:
    def change(values: dict[str, Any]) -> None:
        inner: Any = values
        *way, last = [int(key) if key.isdigit() else key for key in path.split("/")]
        for key in way:
            inner = inner[key]
        if value is KeyError:
            del inner[last]
        else:
            inner[last] = value

    return change


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (changed("format", "mocobot-estimate"), "not a calibration"),
        (changed("version", 2), "version 1"),
        (changed("version", True), "and version 1"),
        (changed("version", KeyError), "version 1, as"),
        (changed("robots", 4), "deviations is .* a list of 4 entries"),
        (changed("trials", KeyError), "missing key 'trials'"),
        (changed("scale_sd", -1.0), "scale_sd is -1.0; it must be a number of at least 0"),
        (changed("design/rod_mass_kg", -1.0), "rod_mass_kg is -1.0; it must be greater than 0"),
        (changed("prior/geometry_mm", 1.0), r"prior: unknown key 'geometry_mm' \(did you mean 'geometry_m'"),
        (changed("deviations/1/tau_zero_Nm/value", [0.0, 0.0]), r"deviations\[2\]: tau_zero_Nm: value is"),
        (changed("deviations/1/tau_zero_Nm/value/0", float("nan")), "3 finite numbers"),
        (changed("covariance/names/0", "omnid9.phi_zero1"), "names is .* such as 'omnid1.phi_zero1'"),
        (changed("payloads/0/parameters/m_kg", 0.0), r"payloads\[1\]: parameters: m_kg is 0.0"),
        (changed("payloads/0/grasps/1/i", 2), r"payloads\[1\]: grasps\[2\]: i is 2; it must be 3"),
        (changed("trials/0/payload", 5), r"trials\[1\]: payload is 5"),
        (changed("trials/0/chi2_per_n/after", None), "after is None; it must be an object"),
        (changed("trials/0/kind", "jump"), "kind is 'jump'; it must be one of 'random'"),
        (changed("findings", [1]), r"findings is \[1\]; it must be a list of texts"),
    ],
)
def test_what_is_no_calibration_is_refused(change: Callable[[dict[str, Any]], None], said: str) -> None:
    values = through_text(calibration_to_dict(invented_calibration(3)))
    change(values)
    with pytest.raises(InputError, match=f"^team.json: .*{said}"):
        calibration_from_dict(values, "team.json")


UNITS = {
    "phi_zero": ("encoder zero phi [deg]", 180 / np.pi),
    "theta_zero": ("encoder zero theta [deg]", 180 / np.pi),
    "radius": ("base minus platform radius [mm]", 1e3),
    "proximal_length": ("proximal length [mm]", 1e3),
    "rod_length": ("rod length [mm]", 1e3),
    "stiffness_ratio": ("spring stiffness [%]", 100.0),
    "tau_zero": ("torque zero [mN m]", 1e3),
    "tilt": ("base tilt [deg]", 180 / np.pi),
    "proximal_mass_ratio": ("proximal mass [%]", 100.0),
    "rod_mass_ratio": ("rod mass [%]", 100.0),
    "wrist_mass_ratio": ("wrist mass [%]", 100.0),
}


@pytest.fixture(scope="module")
def made() -> Calibration:
    return invented_calibration()


@pytest.fixture(scope="module")
def all_free(made: Calibration) -> Calibration:
    """With an error of every deviation, theta_x and single masses included."""
    rng = np.random.default_rng(1)
    units = replace(made.units, x=1e-3 * rng.standard_normal((3, COUNT)))
    covariance = np.diag(rng.uniform(1e-5, 1e-4, 3 * COUNT) ** 2)
    return replace(made, units=units, covariance=covariance, prior=Prior(tilt_rad=0.01, arm_mass_ratio=0.05))


def numbers(line: str) -> list[tuple[float, float]]:
    return [(float(a), float(b)) for a, b in re.findall(r"(-?[\d.]+) \+- ([\d.]+)", line)]


def of_section(text: str, head: str) -> list[str]:
    lines = text.splitlines()
    start = next(k for k, line in enumerate(lines) if line.startswith(f"[[{head}"))
    end = next((k for k in range(start + 1, len(lines)) if lines[k].startswith("[[")), len(lines))
    return lines[start:end]


def same(shown: list[tuple[float, float]], values: np.ndarray, errors: np.ndarray) -> None:
    """To the digits that are shown: the error's second."""
    found = np.array(shown)
    assert found.shape == (len(values), 2)
    np.testing.assert_allclose(found[:, 1], errors, rtol=0.051)
    assert np.all(np.abs(found[:, 0] - values) <= 0.051 * errors)


def test_every_deviation_is_shown_in_its_unit(all_free: Calibration) -> None:
    text = format_calibration(all_free)
    assert [group.name for group in shown_groups(all_free)] == [group.name for group in GROUPS]
    for robot in range(3):
        lines = of_section(text, f"Robot {robot + 1}")[1:]
        assert len(lines) == len(GROUPS)
        for line, group in zip(lines, GROUPS, strict=True):
            name, scale = UNITS[group.name]
            assert line.strip().startswith(name)
            at = AT[group.name]
            same(numbers(line), scale * all_free.units.x[robot, at], scale * all_free.sd[robot, at])
            assert re.findall(r"(\w+): ", line) == [entry for entry in group.entries if entry]


def test_the_payload_is_shown(made: Calibration) -> None:
    lines = of_section(format_calibration(made), "Payload (c)")
    found, grasps = carried(made.payloads[0], made.scale_sd), grasps_of(made.payloads[0], made.scale_sd)
    same(numbers(lines[1]), np.array([11.6]), np.array([found.mass_se_kg]))
    same(numbers(lines[2]), 1e3 * found.p_1c, 1e3 * found.p_1c_se_m)
    same(numbers(lines[3]), found.principal.moments, found.principal.moments_se)
    for k, j in enumerate((2, 3)):
        pair = grasps.pair(1, j)
        assert lines[4 + 2 * k].strip().startswith(f"R_1{j} [deg]")
        same(numbers(lines[4 + 2 * k]), np.rad2deg(pair.axis_angle_rad), np.rad2deg(pair.axis_angle_se_rad))
        same(numbers(lines[5 + 2 * k]), 1e3 * pair.p_ij, 1e3 * pair.p_se_m)
    payload = made.payloads[0]
    scale, noise = 0.0067 * abs(payload.by_scale[-10]), np.sqrt(payload.covariance[-10, -10])
    assert lines[-1].strip().startswith(f"of the mass's error {scale:.2g} kg is that of the springs'")
    assert lines[-1].endswith(f"; {noise:.2g} kg is noise")
    assert found.mass_se_kg == pytest.approx(np.hypot(scale, noise), rel=1e-6)
    weighed = replace(made, scale_sd=0.0, payloads=(replace(payload, label=None),))
    assert not any("common scale" in line for line in of_section(format_calibration(weighed), "Payload]]"))


def test_frames(made: Calibration, all_free: Calibration) -> None:
    assert frames_sentence(made).startswith("frames {i} as the encoders define them")
    assert frames_sentence(all_free) == "frames {i} as in the drawing, from flanges that are parallel"
    assert "are not known" not in unit_toml(all_free, 1)
    assert "theta_x is known: frames are those of the drawing." in unit_toml(all_free, 1)
    assert "not known and set to 0: frames are those that the encoders define." in unit_toml(made, 1)


@pytest.mark.parametrize("robot", [1, 3])
def test_a_robot_as_toml(all_free: Calibration, robot: int) -> None:
    text = unit_toml(all_free, robot)
    values, x, design = tomllib.loads(text), all_free.units.x[robot - 1], all_free.design
    assert text.startswith(f"# Robot {robot} of 3 as calibrated")
    assert f"({design.sea_stiffness_Nm_per_rad:g} N m/rad)" in text

    def of(name: str) -> np.ndarray:
        return x[AT[name]]

    expected = {
        "radius_m": design.base_radius_m - design.platform_radius_m + of("radius"),
        "proximal_length_m": design.proximal_length_m + of("proximal_length"),
        "rod_length_m": design.rod_length_m + of("rod_length"),
        "stiffness_ratio": of("stiffness_ratio"),
        "sea_stiffness_Nm_per_rad": design.sea_stiffness_Nm_per_rad * (1 + of("stiffness_ratio")),
        "phi_zero_rad": of("phi_zero"),
        "theta_zero_rad": of("theta_zero"),
        "tau_zero_Nm": of("tau_zero"),
        "tilt_rad": of("tilt"),
        "proximal_mass_kg": design.proximal_mass_kg * (1 + of("proximal_mass_ratio")),
        "rod_mass_kg": design.rod_mass_kg * (1 + of("rod_mass_ratio")),
        "gravity_mps2": design.gravity_mps2,
        "proximal_com_m": design.proximal_com_m,
    }
    for name, value in expected.items():
        np.testing.assert_allclose(values[name], value, rtol=1e-12, err_msg=name)
    assert isinstance(values["wrist_mass_kg"], float)
    assert values["flange_inertia_kgm2"] == list(np.ravel(design.flange_inertia_kgm2))


ONE_DEG = float(np.deg2rad(1.0))
X = AT["theta_zero"].stop - 1


def as_encoders_say(R_1i: Array, zeros: Array) -> Array:
    """Frames turned about their own x axes by what the encoders read too much."""
    Rx = [Rotation.from_rotvec([z, 0.0, 0.0]).as_matrix() for z in zeros]
    return np.array([Rx[0].T @ R @ each for R, each in zip(R_1i, Rx, strict=True)])


def payload_of(R_1i: Array, p_1i: Array, sd_rad: float = 1e-5, sd_m: float = 1e-4) -> CalibratedPayload:
    N = len(R_1i)
    sd = np.r_[np.tile([sd_rad] * 3 + [sd_m] * 3, N - 1), np.full(10, 1e-3)]
    none, each = np.full((N, N), np.nan), np.full(N, np.nan)
    grasps = GraspEstimate(R_1i, p_1i, np.diag(sd[:-10] ** 2), none, none, each, each)
    parameters = np.array([11.6, 4.0, -6.0, 0.4, 4.5, 2.0, -0.1, 3.5, 0.2, 7.6])
    return CalibratedPayload("x", grasps, parameters, np.diag(sd**2), np.zeros(len(sd)))


def team_of(payload: str, zeros: Array) -> tuple[CalibratedPayload, Array]:
    """A payload as MuJoCo has it, in the frames of encoders with these zeros; and its true rotations."""
    X_1i = build_team(payload).X_1i
    R, p = X_1i.rotation.as_matrix(), X_1i.translation
    about = Rotation.from_rotvec([zeros[0], 0.0, 0.0]).as_matrix()
    return payload_of(as_encoders_say(R, zeros), p @ about), R


@pytest.mark.parametrize("payload", ["a", "b", "c", "d"])
def test_the_projects_payloads_have_parallel_flanges_that_decide_all_zeros(payload: str) -> None:
    truth = np.random.default_rng(3).normal(0.0, ONE_DEG, 3)
    held, R = team_of(payload, truth)
    found = parallel_flanges([held], ONE_DEG)
    np.testing.assert_allclose(found.zeros, truth, atol=5e-6)
    assert np.rad2deg(np.sqrt(np.diag(found.covariance))).max() < 0.002
    angles = Rotation.from_matrix(turned(held.grasps.R_1i, found.zeros) @ np.swapaxes(R, 1, 2)).magnitude()
    assert angles.max() < 1e-5
    assert found.misfit_rad < 1e-7


def test_a_common_turn_about_parallel_x_axes_stays_open() -> None:
    truth = np.array([0.02, -0.015, 0.01])
    R = as_encoders_say(np.tile(np.eye(3), (3, 1, 1)), truth)
    held = payload_of(R, np.random.default_rng(0).normal(size=(3, 3)))
    found = parallel_flanges([held], ONE_DEG)
    np.testing.assert_allclose(found.zeros - found.zeros[0], truth - truth[0], atol=1e-7)
    assert found.zeros.mean() == pytest.approx(0.0, abs=1e-7)  # the prior's
    np.testing.assert_allclose(np.sqrt(np.diag(found.covariance)), ONE_DEG / np.sqrt(3), rtol=1e-3)
    named = in_drawing_frames(replace(invented_calibration(3), payloads=(held,)))
    assert len(named.open) == 2
    assert named.open[1].startswith("Parallel flanges do not decide the zeros of theta_x of robots 1, 2, 3 (")
    # Turned about x with everything else, m c_z moves by m c_y.
    turned_by = np.hypot(6.0 * ONE_DEG / np.sqrt(3), 1e-3)
    assert np.sqrt(named.payloads[0].covariance[-7, -7]) == pytest.approx(turned_by, rel=0.02)
    # A second payload, held with one flange turned, decides it.
    more, _ = team_of("b", truth)
    np.testing.assert_allclose(parallel_flanges([held, more], ONE_DEG).zeros, truth, atol=5e-6)


def test_flanges_that_are_not_parallel_are_found_out() -> None:
    held, _ = team_of("b", np.array([0.01, -0.02, 0.015]))
    bent = held.grasps.R_1i.copy()
    bent[2] = bent[2] @ Rotation.from_euler("y", 1.0, degrees=True).as_matrix()
    made = replace(invented_calibration(3), payloads=(payload_of(bent, held.grasps.p_1i),))
    assert in_drawing_frames(replace(made, payloads=(held,))).findings == made.findings
    named = in_drawing_frames(made)
    assert len(named.findings) == 2
    assert "they are not parallel" in named.findings[1]
    # Errors grow with what is left over: nobody knows which of the flanges is bent.
    assert np.rad2deg(named.sd[:, X]).min() > 0.1


def test_results_move_into_the_frames_of_the_drawing() -> None:
    truth = np.array([0.015, -0.02, 0.01])
    held, _ = team_of("c", truth)
    made = replace(
        invented_calibration(3),
        payloads=(held,),
        open=("zeros of theta_x: turn the grasp frames", "arm masses"),
    )
    named = in_drawing_frames(made)
    assert named.open == ("arm masses",)
    np.testing.assert_allclose(named.units.of("theta_zero")[:, 2], truth, atol=5e-6)
    others = np.delete(np.arange(COUNT), X)
    np.testing.assert_array_equal(named.units.x[:, others], made.units.x[:, others])
    found = named.payloads[0]
    np.testing.assert_allclose(found.grasps.p_1i, build_team("c").X_1i.translation, atol=1e-5)
    Rx = Rotation.from_rotvec([truth[0], 0.0, 0.0])
    np.testing.assert_allclose(found.parameters[1:4], Rx.apply(held.parameters[1:4]), atol=1e-4)
    assert found.parameters[0] == held.parameters[0]
    assert found.covariance[-10, -10] == pytest.approx(held.covariance[-10, -10], rel=1e-6)
    back = calibration_from_dict(calibration_to_dict(named))
    np.testing.assert_array_equal(back.units.x, named.units.x)


def test_errors_cover_what_scatters() -> None:
    """Draws of zeros and of the grasps' errors, against the standard errors of zeros, grasps and centre of mass."""
    rng = np.random.default_rng(11)
    X_1i = build_team("b").X_1i
    R, p = X_1i.rotation.as_matrix(), X_1i.translation
    errors = []
    for _ in range(60):
        zeros = rng.normal(0.0, ONE_DEG, 3)
        about = Rotation.from_rotvec([zeros[0], 0.0, 0.0]).as_matrix()
        exact = payload_of(as_encoders_say(R, zeros), p @ about, 1e-3, 1e-3)
        drawn = np.linalg.cholesky(exact.covariance) @ rng.standard_normal(22)
        noisy = replace(
            exact, grasps=exact.grasps.moved(drawn[:12]), parameters=exact.parameters + drawn[12:]
        )
        done: Calibration = in_drawing_frames(replace(invented_calibration(3), payloads=(noisy,)))
        found = done.payloads[0]
        d = Rotation.from_matrix(R @ np.swapaxes(found.grasps.R_1i, 1, 2)).as_rotvec()[1:]
        e = (p - found.grasps.p_1i)[1:]
        mc = Rotation.from_rotvec([zeros[0], 0.0, 0.0]).apply(exact.parameters[1:4]) - found.parameters[1:4]
        each = np.r_[np.column_stack([d, e]).ravel(), mc]
        at = np.r_[0:12, 13:16]
        sd = np.sqrt(np.diag(found.covariance)[at])
        errors.append(np.r_[(zeros - done.units.of("theta_zero")[:, 2]) / done.sd[:, X], each / sd])
    rms = np.sqrt(np.mean(np.square(errors), axis=0))
    assert (rms > 0.75).all(), rms
    assert (rms < 1.25).all(), rms
