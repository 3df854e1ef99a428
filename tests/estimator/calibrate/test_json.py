"""Calibrations as JSON, and a payload's numbers about its centre of mass."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from estimator.arm.unit import AT, COUNT
from estimator.calibrate.json import calibration_from_dict, calibration_to_dict
from estimator.calibrate.outcome.carried import carried
from estimator.errors import InputError
from invented_calibration import invented_calibration
from mocobot.api.calibration import read_calibration, write_calibration


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
    write_calibration(path, made, {"mocobot": "1"})
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


def test_other_keys_at_the_top_are_ignored() -> None:
    values = through_text(calibration_to_dict(invented_calibration(2))) | {"note": "of Monday"}
    assert asdict(calibration_from_dict(values).prior)["geometry_m"] == 1e-3


def test_inertia_about_the_centre_of_mass_is_that_of_point_masses() -> None:
    """Sums over points know no theorem of parallel axes; the scatter of many draws knows no Jacobian."""
    rng = np.random.default_rng(4)
    points, masses = rng.normal(0.3, 0.4, (6, 3)), rng.uniform(0.5, 2.0, 6)

    def about(origin: np.ndarray) -> np.ndarray:
        r = points - origin
        return sum(m * (x @ x * np.eye(3) - np.outer(x, x)) for m, x in zip(masses, r, strict=True))

    com = masses @ points / masses.sum()
    J = about(np.zeros(3))
    parameters = np.array(
        [masses.sum(), *(masses @ points), J[0, 0], J[0, 1], J[0, 2], J[1, 1], J[1, 2], J[2, 2]]
    )
    spread = 1e-4 * rng.normal(size=(10, 10))
    payload = invented_calibration(2).payloads[0]
    covariance, by_scale = payload.covariance.copy(), payload.by_scale.copy()
    covariance[-10:, -10:], by_scale[-10:] = (
        spread @ spread.T,
        -parameters,
    )  # heavier springs, heavier payload
    made = type(payload)(None, payload.grasps, parameters, covariance, by_scale)
    found = carried(made, 0.01)
    assert found.mass_kg == pytest.approx(masses.sum())
    np.testing.assert_allclose(found.p_1c, com, atol=1e-12)
    np.testing.assert_allclose(found.inertia, about(com), atol=1e-12)
    np.testing.assert_allclose(found.principal.moments, np.linalg.eigvalsh(about(com)))
    draws = (
        parameters + rng.normal(size=(40000, 10)) @ spread.T - 0.01 * rng.normal(size=(40000, 1)) * parameters
    )
    c = draws[:, 1:4] / draws[:, :1]
    xx = draws[:, 4] - draws[:, 0] * (c[:, 1] ** 2 + c[:, 2] ** 2)
    assert found.mass_se_kg == pytest.approx(draws[:, 0].std(), rel=0.02)
    np.testing.assert_allclose(found.p_1c_se_m, c.std(axis=0), rtol=0.02)
    assert found.inertia_se[0, 0] == pytest.approx(xx.std(), rel=0.02)
