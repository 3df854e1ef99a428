"""Recordings that carry the robots as they are: version 5, strict both ways, and what the readings then mean."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from estimator.arm.unit import GROUPS, ArmUnit
from estimator.errors import InputError
from estimator.estimate.payload import estimate_payload
from estimator.estimate.result import PayloadEstimate, format_estimate
from estimator.recording.metadata import RecordingMetadata
from estimator.recording.parquet import read_recording, write_recording
from estimator.signals import process_recording
from omnid_design import DESIGN
from recorded_team import COM, GRASPS, MASS
from recordings import metadata, small_recording
from uncalibrated_team import knowing, true_units, uncalibrated


@pytest.mark.parametrize("changes", [{}, {"level": "wrist"}, {"trial": "free"}])
def test_round_trip(tmp_path: Path, changes: dict[str, Any]) -> None:
    written = small_recording(rows=40, units=true_units(), **changes)
    write_recording(written, tmp_path / "rec.parquet")
    read = read_recording(tmp_path / "rec.parquet")
    assert read.metadata.units is not None
    np.testing.assert_array_equal(read.metadata.units.x, true_units().x)
    assert replace(read.metadata, units=None) == replace(written.metadata, units=None)
    # Readings stay as they were read, whatever the robots are really like.
    np.testing.assert_allclose(read.phi, written.phi, rtol=0, atol=1e-12)
    np.testing.assert_allclose(read.tau, written.tau, rtol=0, atol=1e-10)


def test_the_key_is_written_only_where_it_is_needed() -> None:
    assert json.loads(metadata().to_json())["version"] == 1
    told = json.loads(metadata(units=true_units()).to_json())
    assert (told["version"], told["level"], len(told["units"])) == (5, "joint", 3)
    robot = told["units"][1]
    assert robot["tau_zero_Nm"] == true_units().of("tau_zero")[1].tolist()
    assert [len(values) for values in robot.values()] == [len(group.entries) for group in GROUPS]


def changed(path: str, value: Any) -> Callable[[dict[str, Any]], None]:
    def change(values: dict[str, Any]) -> None:
        *way, last = [int(key) if key.isdigit() else key for key in path.split("/")]
        inner: Any = values
        for key in way:
            inner = inner[key]
        inner[last] = value

    return change


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (changed("units", []), r"units is \[\]; it must be a list with one object for each robot"),
        (changed("units/1", {}), r"units\[1\]: missing key 'phi_zero_rad'"),
        (changed("units/1/phi_zero", 0), r"unknown key 'phi_zero' \(did you mean 'phi_zero_rad'\?\)"),
        (changed("units/0/tilt_rad", [0.0]), r"units\[0\]: tilt_rad is \[0.0\]; it must be 2 finite numbers"),
        (
            changed("units/2/rod_mass_ratio/1", -1.5),
            r"units\[2\]: rod_mass_ratio is -1.5; .* greater than -1$",
        ),
        (changed("units/2/rod_length_m/1", -9.0), r"rod_length_m is -9; it must be greater than -0\.\d+$"),
        (changed("version", 4), "unknown key 'units'"),
    ],
)
def test_what_no_robots_are_is_refused(change: Callable[[dict[str, Any]], None], said: str) -> None:
    values = json.loads(metadata(units=true_units()).to_json())
    change(values)
    with pytest.raises(InputError, match=f"^rec: .*{said}"):
        RecordingMetadata.from_json(json.dumps(values), "rec")


def test_units_of_other_robots_are_not_written() -> None:
    two = ArmUnit(DESIGN, true_units().x[:2])
    with pytest.raises(InputError, match="units: of 2 robots; the recording is of 3"):
        metadata(units=two).to_json()
    heavier = ArmUnit(replace(DESIGN, rod_mass_kg=0.5), true_units().x)
    with pytest.raises(InputError, match="units: of robots of another design than the recording's"):
        metadata(units=heavier).to_json()


def test_motion_and_wrenches_of_robots_as_they_are() -> None:
    """Against an analytic motion, whose joint angles and torques arms as they are were given."""
    carried, units = uncalibrated()
    keep = slice(200, -200)
    data = process_recording(knowing(carried.recording, units), cutoff_hz=20.0)
    np.testing.assert_allclose(data.twist, carried.twist[keep], rtol=0, atol=1e-8)
    np.testing.assert_allclose(data.twist_dot, carried.twist_dot[keep], rtol=0, atol=2e-7)
    np.testing.assert_allclose(data.wrench, carried.wrench[keep], rtol=0, atol=1e-6)
    as_designed = process_recording(carried.recording, cutoff_hz=20.0)
    assert np.abs(as_designed.wrench - carried.wrench[keep]).max() > 1.0
    assert np.abs(as_designed.R_bi - data.R_bi).max() > 1e-3


def test_estimate_on_robots_as_they_are() -> None:
    carried, units = uncalibrated()
    found = estimate_payload([knowing(carried.recording, units)])
    assert found.contradicts is False
    assert found.mass is not None
    assert found.grasps is not None
    assert found.mass.mass == pytest.approx(MASS, rel=1e-6)
    np.testing.assert_allclose(found.p_1c, COM, atol=1e-6)
    np.testing.assert_allclose(found.grasps.p_1i, [p for _, p in GRASPS], atol=1e-6)
    assert estimate_payload([carried.recording]).contradicts is True
    # Its JSON says which robots it is of, and that of an estimate on robots as designed says nothing.
    again = PayloadEstimate.from_dict(json.loads(json.dumps(found.to_dict(), allow_nan=False)))
    assert again.units is not None
    np.testing.assert_array_equal(again.units.x, units.x)
    assert again.units.design == DESIGN
    assert "3 calibrated robots, " in format_estimate(again)
