"""A calibration in use: recordings that know their robots, estimates with its errors, and estimates from it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from estimator.calibrate.calibrate import calibrate
from estimator.calibrate.calibration import Calibration
from estimator.calibrate.outcome.apply import calibrated
from estimator.calibrate.outcome.estimate import estimate_calibrated, with_errors_of
from estimator.errors import InputError
from estimator.estimate.payload import estimate_payload
from estimator.recording.model import Recording
from invented_calibration import invented_calibration
from recorded_team import COM, GRASPS, INERTIA, MASS
from recordings import small_recording
from uncalibrated_team import DEFAULT, uncalibrated


@pytest.fixture(scope="module")
def recordings() -> list[Recording]:
    """Two trials of robots off in what a calibration looks for unasked."""
    return [
        replace(uncalibrated(seed=seed, without=DEFAULT)[0].recording, name=f"trial{seed}") for seed in (4, 5)
    ]


@pytest.fixture(scope="module")
def made(recordings: list[Recording]) -> Calibration:
    return calibrate(recordings)


def test_a_recording_takes_the_robots_and_keeps_its_samples() -> None:
    calibration, recording = invented_calibration(3), small_recording()
    known = calibrated(recording, calibration)
    assert known.metadata.units is calibration.units
    assert known.phi is recording.phi
    assert recording.metadata.units is None


def test_a_calibration_of_other_robots_is_refused() -> None:
    with pytest.raises(
        InputError, match=r"^c\.json is of 2 robots and recording of 3 robots; a calibration is"
    ):
        calibrated(small_recording(), invented_calibration(2), "c.json")
    other = small_recording(design=replace(small_recording().metadata.design, rod_mass_kg=0.3))
    with pytest.raises(InputError, match=r"^the calibration and recording differ in design"):
        calibrated(other, invented_calibration(3))


def test_estimate_from_a_calibration(recordings: list[Recording], made: Calibration) -> None:
    """Analytic motion of robots 1 deg, 1 mm and 2 % off; a mean of springs that is the design's."""
    assert estimate_payload(recordings).contradicts is True
    found = estimate_calibrated(made, recordings)
    assert (found.method, found.contradicts) == ("calibrated", False)
    assert found.mass is not None
    assert found.grasps is not None
    assert found.inertia is not None
    assert found.p_1c is not None
    np.testing.assert_allclose(found.grasps.p_1i, [p for _, p in GRASPS], atol=2e-4)
    np.testing.assert_allclose(found.grasps.R_1i, [R for R, _ in GRASPS], atol=2e-5)
    assert found.mass.mass == pytest.approx(MASS, rel=2e-3)
    np.testing.assert_allclose(found.p_1c, COM, atol=3e-4)
    np.testing.assert_allclose(found.inertia.inertia, INERTIA, atol=0.02)
    # The held scale of all springs is in the errors of mass and inertia: they grow and shrink with it.
    assert found.mass.se / MASS == pytest.approx(made.scale_sd, rel=0.05)
    share = found.inertia.principal.moments_se / found.inertia.principal.moments
    np.testing.assert_allclose(share, made.scale_sd, rtol=0.2)
    assert set(made.open) <= set(found.flags)
    assert max(record.force_residual or 1.0 for record in found.recordings) < 1e-3


def test_a_frozen_calibration_leaves_its_scale_in_the_errors(
    recordings: list[Recording], made: Calibration
) -> None:
    bare = estimate_payload([calibrated(recordings[0], made)])
    found = with_errors_of(made, bare)
    assert bare.mass is not None
    assert bare.inertia is not None
    assert found.mass is not None
    assert found.inertia is not None
    assert found.mass.mass == bare.mass.mass
    assert found.mass.se == pytest.approx(np.hypot(bare.mass.se, made.scale_sd * bare.mass.mass))
    scaled = made.scale_sd * bare.inertia.inertia[0, 0]
    expected = np.hypot(np.sqrt(bare.inertia.covariance[0, 0]), scaled)
    assert np.sqrt(found.inertia.covariance[0, 0]) == pytest.approx(expected)
    assert "0.67 %" in found.flags[-1]
    weighed = replace(made, scale_sd=0.0)
    assert with_errors_of(weighed, bare) is bare


def test_an_estimate_is_of_one_payload(recordings: list[Recording], made: Calibration) -> None:
    other = replace(recordings[0], metadata=replace(recordings[0].metadata, payload="b"))
    with pytest.raises(
        InputError, match="of payload 'b'; the calibration has None, and an estimate is of one"
    ):
        estimate_calibrated(made, [other])
