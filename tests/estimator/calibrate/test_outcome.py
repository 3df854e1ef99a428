"""A calibration in use: recordings that know their robots, estimates with its errors, and estimates from it."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from estimator.calibrate.calibrate import calibrate
from estimator.calibrate.calibration import Calibration, calibrated
from estimator.errors import InputError
from estimator.estimate.fit import estimate_calibrated, estimate_on
from estimator.estimate.payload import Method, estimate_payload
from estimator.estimate.result import PayloadEstimate, format_estimate
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
    assert made.open
    assert found.open == made.open
    again = PayloadEstimate.from_dict(json.loads(json.dumps(found.to_dict(), allow_nan=False)))
    assert again.open == made.open
    assert made.open[0] in format_estimate(again)
    assert found.flags == ()
    assert max(record.force_residual or 1.0 for record in found.recordings) < 1e-3


@pytest.mark.parametrize("method", ["auto", "joint"])
def test_estimate_on_robots_held(recordings: list[Recording], made: Calibration, method: Method) -> None:
    """Errors of the calibration are in those of the estimate, whatever its method."""
    found = estimate_on(made, recordings[:1], method)
    bare = estimate_payload([calibrated(recordings[0], made)], "joint")
    assert found.method == ("calibrated" if method == "auto" else "joint")
    assert found.contradicts is False
    assert found.mass is not None
    assert bare.mass is not None
    assert found.inertia is not None
    assert found.p_1c is not None
    assert found.p_1c_se_m is not None
    assert bare.p_1c_se_m is not None
    assert found.mass.mass == pytest.approx(MASS, rel=2e-3)
    np.testing.assert_allclose(found.p_1c, COM, atol=3e-4)
    assert found.mass.se / MASS == pytest.approx(made.scale_sd, rel=0.05)
    assert bare.mass.se < 0.1 * found.mass.se
    assert np.all(np.abs(found.p_1c - COM) < 4 * found.p_1c_se_m)
    assert np.all(found.p_1c_se_m > bare.p_1c_se_m)


def test_too_little_for_the_errors_is_said(recordings: list[Recording], made: Calibration) -> None:
    """One posture: holds give the mass, and no fit of grasps."""
    still = replace(
        recordings[0],
        **{
            name: np.repeat(getattr(recordings[0], name)[:1], 1200, axis=0)
            for name in ("phi", "theta", "tau")
        },
        time=recordings[0].time[:1200],
    )
    still.tau[:] += 1e-6 * np.random.default_rng(0).normal(size=still.tau.shape)  # or it is one reading
    found = estimate_on(made, [still])
    assert found.method == "staged"
    assert found.mass is not None
    assert "Standard errors lack those of the robots' calibration" in found.flags[-1]


def test_an_estimate_is_of_one_payload(recordings: list[Recording], made: Calibration) -> None:
    other = replace(recordings[0], metadata=replace(recordings[0].metadata, payload="b"))
    with pytest.raises(
        InputError, match="of payload 'b'; the calibration has None, and an estimate is of one"
    ):
        estimate_calibrated(made, [other])
