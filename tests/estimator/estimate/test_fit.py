"""The default estimator, and estimates on calibrated robots."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimator.arm.unit import COUNT, ArmUnit
from estimator.calibrate.calibrate import calibrate
from estimator.calibrate.calibration import Calibration, calibrated
from estimator.calibrate.prior import Prior
from estimator.errors import InputError
from estimator.estimate.fit import ONE_FIT as METHOD
from estimator.estimate.fit import WITHOUT_ERRORS, Asked, estimate, estimate_calibrated, estimate_on
from estimator.estimate.payload import Method, estimate_payload
from estimator.estimate.result import PayloadEstimate, format_estimate
from estimator.estimate.uncertainty import standard_errors
from estimator.filtering import low_pass
from estimator.recording.model import Recording
from invented_calibration import invented_calibration
from omnid_design import DESIGN
from recorded_team import COM, GRASPS, INERTIA, MASS, Sines
from recordings import small_recording
from synthetic_team import Load, carry, draw_path, draw_units, load, with_noise
from uncalibrated_team import DEFAULT, uncalibrated

DESIGNED = ArmUnit(DESIGN, np.zeros((3, COUNT)))
ANGLE_RAD, TORQUE_NM = 3e-5, 0.01


def team(seed: int, units: ArmUnit = DESIGNED, trials: int = 2) -> tuple[Load, list[Recording]]:
    """Noisy trials of a payload that robots carry who are what they are."""
    rng = np.random.default_rng(seed)
    held = load(3, rng)
    exact = [carry(units, held, draw_path(held, rng), rng, 14.0) for _ in range(trials)]
    recordings = [with_noise(one.recording, ANGLE_RAD, TORQUE_NM, rng) for one in exact]
    return held, [replace(one, name=f"trial {k + 1}") for k, one in enumerate(recordings)]


@pytest.fixture(scope="module")
def good() -> tuple[Load, list[Recording]]:
    return team(1)


def errors(found: PayloadEstimate, held: Load) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Errors and their covariances."""
    assert found.grasps is not None
    assert found.mass is not None
    assert found.p_1c is not None
    assert found.p_1c_covariance is not None
    assert found.inertia is not None
    turn = Rotation.from_matrix(found.grasps.R_1i[1:] @ np.swapaxes(held.R_1i[1:], 1, 2)).as_rotvec()
    grasps = np.concatenate([turn, found.grasps.p_1i[1:] - held.p_1i[1:]], axis=1).ravel()
    inertia = found.inertia.inertia[np.triu_indices(3)] - held.inertia[np.triu_indices(3)]
    return {
        "grasps": (grasps, found.grasps.covariance),
        "mass": (np.array([found.mass.mass - held.mass]), np.array([[found.mass.se**2]])),
        "com": (found.p_1c - held.com, found.p_1c_covariance),
        "inertia": (inertia, found.inertia.covariance),
    }


def test_the_fit_is_nearer_the_truth_than_the_others_and_knows_how_near() -> None:
    squares: dict[Asked, list[float]] = {"auto": [], "joint": []}
    nees: dict[str, list[float]] = {}
    for seed in range(10, 18):
        held, recordings = team(seed)
        for method, found in squares.items():
            done = estimate(recordings, method)
            assert done.method == (METHOD if method == "auto" else method)
            off = errors(done, held)
            found.append(float(np.sum(off["grasps"][0] ** 2)))
            if method == "auto":
                assert (done.flags, done.why_not_fit) == ((), "")
                for name, (error, covariance) in off.items():
                    part = float(error @ np.linalg.solve(covariance, error)) / len(error)
                    nees.setdefault(name, []).append(part)
    assert np.sqrt(np.mean(squares["auto"])) < 0.6 * np.sqrt(np.mean(squares["joint"]))
    # The mean of 8 draws of chi2/n lies in these bands 999 times in 1000 (n = 12, 1, 3, 6).
    for name, low, high in (
        ("grasps", 0.61, 1.54), ("mass", 0.10, 3.5), ("com", 0.30, 2.3), ("inertia", 0.46, 1.8),
    ):  # fmt: skip
        assert low < np.mean(nees[name]) < high, name


def test_robots_that_are_not_as_designed_leave_the_stages_as_they_were() -> None:
    """A robot off by a hundredth of what is usual: too little for stages to see, too much for one fit."""
    _, recordings = team(3, draw_units(3, Prior().scaled(0.01), np.random.default_rng(4)))
    found, before = estimate(recordings), estimate_payload(recordings)
    assert (found.method, before.method) == ("joint", "joint")
    assert found.why_not_fit.startswith(
        "Joint, and not in one fit of loops and balance: that leaves more than noise, to which it is more sensitive "
        "(chi2/n is "
    )
    assert replace(found, why_not_fit="").to_dict() == before.to_dict()
    assert found.why_not_fit in format_estimate(found)
    again = PayloadEstimate.from_dict(json.loads(json.dumps(found.to_dict(), allow_nan=False)))
    assert again.why_not_fit == found.why_not_fit
    asked = estimate(recordings, "fit")
    assert (asked.method, asked.why_not_fit) == (METHOD, "")


@pytest.mark.parametrize("size", [0.0, 0.1])
def test_friction_is_no_noise(good: tuple[Load, list[Recording]], size: float) -> None:
    rubbing = []
    for recording in good[1]:
        tau = recording.tau.copy()
        tau[:, 0, 1] += size * np.sign(np.gradient(low_pass(recording.phi[:, 0, 1], 100.0, 5.0)))
        rubbing.append(replace(recording, tau=tau))
    found = estimate(rubbing)
    assert found.method == ("joint" if size else METHOD)
    assert ("in the balance of trial" in found.why_not_fit) is bool(size)


def test_a_channel_that_sticks_is_no_noise(good: tuple[Load, list[Recording]]) -> None:
    phi = good[1][0].phi.copy()
    phi[600:630, 1, 1] = phi[600, 1, 1]
    found = estimate([replace(good[1][0], phi=phi), good[1][1]])
    assert found.method == "joint"
    assert "in the loops of trial 1" in found.why_not_fit


def yawing(tilt_rad: float, seed: int) -> tuple[Load, Recording]:
    """One noisy trial in which the payload yaws, and tilts that little."""
    rng = np.random.default_rng(seed)
    held = load(3, rng)
    path = Sines.draw(rng, [tilt_rad, tilt_rad, 0.04, 0.003, 0.003, 1e-4], 3, 0.1, 0.9)
    return held, with_noise(carry(DESIGNED, held, path, rng, 18.0).recording, ANGLE_RAD, TORQUE_NM, rng)


def test_weak_motion_has_large_errors_and_no_wrong_ones() -> None:
    """The twists do not tell the inertia; the fit leaves it as uncertain as it is, and what goes with it."""
    held, recording = yawing(1e-3, 1)
    before, found = estimate_payload([recording]), estimate([recording])
    assert before.inertia is None
    assert found.method == METHOD
    assert found.inertia is not None
    assert not found.undetermined
    off = errors(found, held)
    for error, covariance in off.values():
        assert np.all(np.abs(error) < 3.5 * standard_errors(covariance))
    assert standard_errors(found.p_1c_covariance)[2] > 20 * standard_errors(found.p_1c_covariance)[0]


def test_an_inertia_as_uncertain_as_itself_is_not_reported() -> None:
    held, recording = yawing(2e-4, 2)
    found = estimate([recording])
    assert found.method == METHOD
    assert found.inertia is None
    assert {weak.step for weak in found.undetermined} == {"inertia"}
    assert "a third of the inertia" in found.undetermined[0].reason
    assert np.all(np.abs(found.p_1c - held.com) < 3.5 * standard_errors(found.p_1c_covariance))


def one_robot(recording: Recording) -> Recording:
    told = replace(recording.metadata, robots=1)
    parts = {name: getattr(recording, name)[:, :1] for name in ("phi", "theta", "tau")}
    return replace(recording, metadata=told, **parts)


def at_rest(recording: Recording) -> Recording:
    parts = {name: np.repeat(getattr(recording, name)[:1], 1200, axis=0) for name in ("phi", "theta", "tau")}
    parts["tau"] += 1e-6 * np.random.default_rng(0).normal(size=parts["tau"].shape)  # or it is one reading
    return replace(recording, time=recording.time[:1200], **parts)


@pytest.mark.parametrize(
    ("changed", "why"),
    [
        (one_robot, "one robot closes no loop."),
        (at_rest, "these recordings do not determine the grasps."),
    ],
)
def test_recordings_that_do_not_serve_a_fit(good: tuple[Load, list[Recording]], changed, why: str) -> None:
    recording = changed(good[1][0])
    found, before = estimate([recording]), estimate_payload([recording])
    assert found.why_not_fit.endswith(f", and not in one fit of loops and balance: {why}")
    assert replace(found, why_not_fit="").to_dict() == before.to_dict()
    with pytest.raises(InputError, match=r"no fit of loops and balance \(" + why[:-1]):
        estimate([recording], "fit")


def test_robots_that_the_recordings_know_are_held_so_and_their_errors_missed() -> None:
    units = draw_units(3, Prior(), np.random.default_rng(4))
    held, recordings = team(3, units)
    found = estimate([replace(one, metadata=replace(one.metadata, units=units)) for one in recordings])
    assert found.method == METHOD
    assert found.open == (WITHOUT_ERRORS,)
    off = errors(found, held)
    for error, covariance in off.values():
        assert np.all(np.abs(error) < 4.0 * standard_errors(covariance))


def test_recordings_are_let_go_one_by_one(good: tuple[Load, list[Recording]]) -> None:
    """An iterator's recordings are read when their turn comes, and an error in a later one is its own."""
    asked = []

    def each() -> Iterator[Recording]:
        for recording in good[1]:
            asked.append(recording.name)
            yield recording
        raise InputError("the third is broken")

    with pytest.raises(InputError, match=r"^the third is broken$"):
        estimate(each())
    assert asked == ["trial 1", "trial 2"]


@pytest.fixture(scope="module")
def recordings() -> list[Recording]:
    """Two trials of robots off in what a calibration looks for unasked."""
    return [
        replace(uncalibrated(seed=seed, without=DEFAULT)[0].recording, name=f"trial{seed}") for seed in (4, 5)
    ]


@pytest.fixture(scope="module")
def made(recordings: list[Recording]) -> Calibration:
    return calibrate(recordings)


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
