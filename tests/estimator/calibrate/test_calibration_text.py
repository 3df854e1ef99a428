"""A calibration as text and as TOML: every number that a reader sees is that of the calibration, in its unit."""

from __future__ import annotations

import re
import tomllib
from dataclasses import replace

import numpy as np
import pytest

from estimator.arm.unit import AT, COUNT, GROUPS
from estimator.calibrate.calibration import Calibration, Prior, carried, grasps_of
from estimator.calibrate.text import format_calibration, frames_sentence, shown_groups, unit_toml
from invented_calibration import invented_calibration

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


def test_what_is_held_is_not_shown(made: Calibration) -> None:
    text = format_calibration(made)
    names = {group.name for group in shown_groups(made)}
    assert names == set(UNITS) - {"tilt", "proximal_mass_ratio", "rod_mass_ratio", "wrist_mass_ratio"}
    theta = next(line for line in of_section(text, "Robot 1") if "theta" in line)
    assert theta.endswith("x: held")
    assert len(numbers(theta)) == 2
    mass = of_section(text, "All arms together")[1]
    at = AT["wrist_mass_ratio"].start
    same(numbers(mass), 100 * made.units.x[0, [at]], 100 * made.sd[0, [at]])
    free = replace(made, prior=Prior(arm_mass_ratio=0.05))
    assert "All arms together" not in format_calibration(free)
    assert "wrist_mass_ratio" in {group.name for group in shown_groups(free)}


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


def test_recordings_are_shown(made: Calibration) -> None:
    text = format_calibration(made)
    assert text.startswith("[[Calibration]]  3 robots, 4 recordings, 150 s, 4 steps\n")
    head, *rows = of_section(text, "Recordings")[1:]
    assert head.split() == ["length", "as", "designed", "calibrated", "left", "out"]
    cells = [re.split(r"\s{2,}", row.strip()) for row in rows]
    assert cells == [
        ["random.parquet", "random", "40.0 s", "60000 / 9000", "0.90 / 1.00", "1.50 / 1.10"],
        ["periodic.parquet", "periodic", "40.0 s", "66000 / 9900", "0.99 / 1.10", "1.65 / 1.21"],
        ["static.parquet", "static", "40.0 s", "72600 / 10890", "1.09 / 1.21", "1.82 / 1.33"],
        ["free.parquet", "free", "30.0 s", "-", "- / 1.02", "-"],
    ]
    assert len({len(row.split("  0.")[0]) for row in rows[:2]}) == 1
    once = format_calibration(replace(made, trials=made.trials[:1]))
    assert "1 recording, 40 s" in once


def test_sentences_are_shown(made: Calibration) -> None:
    text = format_calibration(made)
    assert of_section(text, "Findings")[1] == "    the payload slipped"
    assert of_section(text, "What stays open")[1].strip() == made.open[0]
    bare = format_calibration(replace(made, findings=(), open=()))
    assert "[[Findings]]" not in bare
    assert of_section(bare, "What stays open")[1] == "    Nothing."
    words = "word " * 60
    long = of_section(format_calibration(replace(made, findings=(words,))), "Findings")[1:]
    assert max(map(len, long)) <= 118
    assert min(map(len, long[:-1])) > 110
    assert [line[:9].count(" ") >= 8 for line in long] == [False, True, True]


def test_deviations_that_were_hardly_touched(made: Calibration) -> None:
    assert made.untouched == ()
    assert "Hardly touched" not in format_calibration(made)
    covariance = made.covariance.copy()
    for name, share in (("tau_zero", 0.91), ("rod_length", 0.89)):
        at = COUNT + AT[name].start + 1
        covariance[at, at] = (share * made.prior_sd[1, AT[name].start + 1]) ** 2
    touched = replace(made, covariance=covariance)
    assert touched.untouched == ("omnid2.tau_zero2",)
    assert "[[Hardly touched by these recordings]]\n    omnid2.tau_zero2\n" in format_calibration(touched)


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
