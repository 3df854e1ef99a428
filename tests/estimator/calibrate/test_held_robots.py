"""Payloads of robots that an earlier calibration holds: its values are used, its errors go on to the payload."""

from dataclasses import replace

import numpy as np
import pytest

from estimator.arm.unit import AT, COUNT
from estimator.calibrate.calibrate import calibrate
from estimator.calibrate.calibration import Calibration, Prior
from estimator.errors import InputError
from estimator.recording.model import Recording
from recorded_team import COM, GRASPS, INERTIA, MASS, Sines, carry

DESIGNED = Prior().scaled(0.0)


@pytest.fixture(scope="module")
def recording() -> Recording:
    """9 s of three robots exactly as designed, whose torques are read in steps of 1 mN m."""
    rng = np.random.default_rng(4)
    path = Sines.draw(rng, [0.06] * 3 + [0.02] * 3, 6, 0.1, 1.0)
    exact = carry(path, Sines.draw(rng, [4.0] * 3, 6, 0.1, 1.0), 9.0).recording
    return replace(exact, tau=np.round(exact.tau, 3))


@pytest.fixture(scope="module")
def designed(recording: Recording) -> Calibration:
    return calibrate([recording], prior=DESIGNED)


def carried(found: Calibration) -> np.ndarray:
    """Positions of grasps 2 and 3, then the inertial parameters."""
    return np.concatenate([found.payloads[0].grasps.p_1i[1:].ravel(), found.payloads[0].parameters])


def test_robots_held_as_designed_give_the_payload(designed: Calibration) -> None:
    found = designed.payloads[0]
    assert not designed.units.x.any()
    np.testing.assert_allclose(found.grasps.p_1i, [p for _, p in GRASPS], atol=2e-5)
    np.testing.assert_allclose(found.grasps.R_1i, [R for R, _ in GRASPS], atol=2e-5)
    np.testing.assert_allclose(found.parameters[:4], [MASS, *(MASS * COM)], rtol=5e-4)
    about_1 = INERTIA + MASS * (COM @ COM * np.eye(3) - np.outer(COM, COM))
    np.testing.assert_allclose(found.parameters[[4, 7, 9]], np.diag(about_1), rtol=1e-3)


def test_errors_of_held_robots_go_on_to_the_payload(recording: Recording, designed: Calibration) -> None:
    """Held elsewhere, the payload comes out elsewhere; the covariance predicts by how much."""
    moved = np.zeros((3, COUNT))
    moved[1, AT["phi_zero"]] = [6e-5, -3e-5, 0.0]
    moved[2, AT["rod_length"]] = [0.0, 1e-5, 0.0]
    moved[0, AT["stiffness_ratio"]] = [0.0, 0.0, 1.5e-4]
    there = calibrate([recording], robots=replace(designed, units=designed.units.moved(moved)))
    uncertain = replace(designed, covariance=np.outer(moved, moved))
    held = calibrate([recording], robots=uncertain)
    np.testing.assert_array_equal(there.units.x, moved)
    np.testing.assert_array_equal(held.covariance, uncertain.covariance)

    change = carried(there) - carried(designed)
    sd_before, sd = (
        np.sqrt(
            np.r_[
                np.diag(c.payloads[0].covariance)[[3, 4, 5, 9, 10, 11]],
                np.diag(c.payloads[0].covariance)[12:],
            ]
        )
        for c in (designed, held)
    )
    foretold = np.sqrt(sd**2 - sd_before**2)
    large = np.abs(change) > 0.05 * np.abs(change).max()
    np.testing.assert_allclose(foretold[large], np.abs(change)[large], rtol=0.03)


def test_common_spring_scale_goes_on(recording: Recording, designed: Calibration) -> None:
    """Springs 1 % stiffer than held: mass and inertia are 1 % more, but for the arms' own weight."""
    by_scale = np.zeros((3, COUNT))
    by_scale[:, AT["stiffness_ratio"]] = 1.0
    stiffer = designed.units.moved(0.01 * by_scale)
    held = calibrate([recording], robots=replace(designed, by_scale=by_scale, scale_sd=0.5))
    there = calibrate([recording], robots=replace(designed, units=stiffer))
    mass = held.payloads[0].parameters[0]
    change = there.payloads[0].parameters[0] - mass
    assert held.payloads[0].by_scale[12] == pytest.approx(change / 0.01, rel=0.01)
    assert change > 0.01 * mass


def test_what_cannot_change_held_robots_is_refused(recording: Recording, designed: Calibration) -> None:
    for more in ({"prior": Prior()}, {"known_mass": {"": (MASS, 0.01)}}, {"free": [recording]}):
        with pytest.raises(
            InputError, match="robots are held as calibrated: unloaded arms, a prior or a known"
        ):
            calibrate([recording], robots=designed, **more)
    pair = replace(designed, units=replace(designed.units, x=np.zeros((2, COUNT))))
    with pytest.raises(InputError, match="the calibration is of 2 robots and the recording of 3"):
        calibrate([recording], robots=pair)
