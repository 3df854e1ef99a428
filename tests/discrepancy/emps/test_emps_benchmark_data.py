"""The benchmark's own recordings; skipped where they are not."""

from __future__ import annotations

import numpy as np
import pytest

from discrepancy.emps.diagnosis import also_fitted
from discrepancy.emps.rig import EmpsRig
from discrepancy.emps.staircase import errors
from discrepancy.engine.diagnose import Diagnosis
from emps_data import DATA, PULSES
from emps_made import needed_data
from emps_pulses import found_pulses, scored
from mocobot_sim.emps.plant import PulseTrain

pytestmark = pytest.mark.slow

REFERENCE_PERCENT = 3.4
"""Force left by an independent least squares with mass, Coulomb, viscous friction and offset."""


@pytest.fixture(scope="module")
def first() -> tuple[EmpsRig, Diagnosis, PulseTrain | None, float]:
    return found_pulses(needed_data() / DATA, closed_loop=False)


@pytest.fixture(scope="module")
def second() -> tuple[EmpsRig, Diagnosis, PulseTrain | None, float]:
    return found_pulses(needed_data() / PULSES, closed_loop=False)


def values(diagnosis: Diagnosis) -> dict[str, float]:
    return {item.candidate.cause: float(item.values[0]) for item in diagnosis.causes}


def test_friction_of_the_axis_is_named(first) -> None:
    _, diagnosis, _, _ = first
    found = values(diagnosis)
    assert diagnosis.verdict == "partly_explained"  # 99.9 % of the misfit, but what is left is not noise
    assert {"mass", "coulomb_friction", "viscous_friction", "asymmetric_viscous"} <= set(found)
    assert not set(found) & {"force_offset", "push", "backlash", "injected_force", "injected_voltage"}
    assert 100.0 + found["mass"] == pytest.approx(95.0, abs=1.5)  # 94.7 by the reference
    assert found["coulomb_friction"] == pytest.approx(21.5, abs=2.5)  # 20.5
    assert found["viscous_friction"] == pytest.approx(195.0, abs=20.0)  # 203
    assert found["velocity_lag"] == pytest.approx(1e-3, abs=2e-5)


def test_force_and_response_are_better_than_least_squares_made_them(first, second) -> None:
    """In sample and on the other recording; held-out blocks are what the closed loop of a diagnosis is run on."""
    rig, diagnosis, _, _ = first
    other, there, _, _ = second
    found = [(f.candidate, f.values) for f in diagnosis.causes]
    injected = [(f.candidate, f.values) for f in there.causes if f.candidate.cause == "injected_voltage"]
    here = errors(rig, [found] * len(rig.blocks))
    elsewhere = errors(other, [[*found, *injected]] * len(other.blocks))
    assert errors(rig, [[]] * len(rig.blocks)).force_percent > 65.0
    assert here.force_percent < 0.6 * REFERENCE_PERCENT
    assert here.position_um < 1.2
    assert here.voltage_mV < 50.0
    assert elsewhere.force_percent < REFERENCE_PERCENT
    assert elsewhere.position_um < 2.0
    assert elsewhere.voltage_mV < 80.0


def test_pulses_are_those_of_the_log(second) -> None:
    rig, diagnosis, train, se = second
    assert train is not None
    score = scored(needed_data() / PULSES, train)
    assert abs(score["start_error_s"]) < 1e-6
    assert abs(score["period_error_s"]) < 1e-6
    assert abs(score["width_error_s"]) < 1e-6
    assert score["samples_agreeing"] == 1.0
    assert score["size_over_log"] == pytest.approx(1.0, abs=0.02)
    assert se < 1e-3
    assert "injected_force" not in values(diagnosis)
    other, spread = also_fitted(rig, diagnosis.explanation, ("injected_force",))["injected_force"]
    assert abs(other) < 5.0 * spread


def test_nothing_of_the_kind_is_in_the_first_recording(first) -> None:
    rig, diagnosis, train, _ = first
    assert train is None
    size, se = also_fitted(rig, diagnosis.explanation, ("injected_voltage",))["injected_voltage"]
    assert abs(size) < 1e-3
    assert abs(size) < 5.0 * se


def test_both_recordings_are_of_one_axis(first, second) -> None:
    one, two = (values(item[1]) for item in (first, second))
    assert two["mass"] == pytest.approx(one["mass"], abs=2.0)
    assert two["asymmetric_viscous"] == pytest.approx(one["asymmetric_viscous"], abs=3.0)
    assert two["delay"] == pytest.approx(one["delay"], abs=1e-4)
    assert two["velocity_lag"] == pytest.approx(one["velocity_lag"], abs=1e-5)


def test_loop_gains_are_nearly_nominal(first) -> None:
    rig, diagnosis, _, _ = first
    also = also_fitted(rig, diagnosis.explanation, ("position_gain", "velocity_gain"))
    assert abs(also["position_gain"][0]) < 0.02
    assert abs(also["velocity_gain"][0]) < 0.3
    assert all(0 < se < 0.1 for _, se in also.values())


def test_noise_of_the_first_recording_comes_from_its_cycles(first) -> None:
    rig = first[0]
    assert rig.noise.repeats == 4
    assert np.all([len(b) > 500 for b in rig.reduction.samples])
