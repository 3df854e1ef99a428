"""Standard errors beside sensors whose noise does not carry readings from one code to the next."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimator.estimate.leftover import Steps, rounded, steps_of
from estimator.estimate.statics import estimate_com, estimate_mass
from estimator.signals import find_holds
from recordings import small_recording
from rigid_body_data import GRAVITY, make_body
from test_statics import TILTS, exact_grasps, exact_hold, force_record

STEP_N = 0.25
STEPS = Steps(1e-4, 1e-4, 0.05, 0.2, 5.0, force_N=STEP_N, read_hz=100.0, still_rad2=np.zeros(1))


@pytest.mark.parametrize(("noise", "least", "most"), [(0.0, 0.85, 1.15), (0.1, 0.7, 1.2), (1.0, 0.8, 1.25)])
def test_one_hold_of_coarse_readings(noise: float, least: float, most: float) -> None:
    """The error of the mean over the standard error, whether noise averages the rounding out or not."""
    rng, ratios = np.random.default_rng(4), []
    for _ in range(150):
        force = np.array([0.0, 0.0, 20.0]) + rng.uniform(0.0, STEP_N, 3)
        read = np.round((force + noise * STEP_N * rng.normal(size=(900, 3))) / STEP_N) * STEP_N
        holds = [STEPS.of_hold(hold) for hold in find_holds(force_record(read))]
        if holds:  # noise near a step may look like a change
            mass = estimate_mass(holds, GRAVITY)
            ratios.append((mass.mass - force[2] / GRAVITY) / mass.se)
    assert len(ratios) > 80
    assert least < np.sqrt(np.mean(np.square(ratios))) < most


def test_rounding_does_not_count_twice_beside_scatter_between_holds() -> None:
    body = make_body(3)
    rng = np.random.default_rng(5)
    tilts = [Rotation.from_euler("xy", tilt).as_matrix() for tilt in TILTS]
    loose = [exact_hold(body, R, rng, bias=0.1, noise=0.0) for R in tilts]
    exact = [exact_hold(body, R, rng) for R in tilts]
    for holds, same in ((loose, True), (exact, False)):
        told = [STEPS.of_hold(hold) for hold in holds] if not same else [
            Steps(1e-4, 1e-4, 0.05, 0.2, 5.0, 0.01, 100.0, np.zeros(1)).of_hold(hold) for hold in holds
        ]  # fmt: skip
        mass, grasps = estimate_mass(told, GRAVITY), exact_grasps(body)
        com, _ = estimate_com(told, mass, grasps, GRAVITY)
        assert com is not None
        if same:
            assert mass == estimate_mass(holds, GRAVITY)
        else:
            least = np.sqrt(3 * STEP_N**2 / 12 / len(TILTS)) / GRAVITY
            assert mass.se == pytest.approx(least)
            levers = np.sqrt(np.mean(np.sum(grasps.p_1i**2, axis=1)) * 3)
            typical = levers * STEP_N / np.sqrt(12) / (body.mass * GRAVITY)
            assert np.sqrt(np.trace(com.covariance[1:, 1:])) > 0.3 * typical


def test_what_noise_leaves_of_rounding() -> None:
    """The variance of the mean of many rounded readings, over true values anywhere between two codes."""
    rng = np.random.default_rng(6)
    for noise in (0.0, 0.1, 0.2, 0.3, 0.5):
        true = rng.uniform(0.0, 1.0, 2000)
        read = np.round(true[:, None] + noise * rng.normal(size=(2000, 800)))
        error = np.mean((read.mean(axis=1) - true) ** 2) - noise**2 / 800
        told = rounded(1.0, np.mean(np.var(read, axis=1)))
        assert 0.95 * error - 1e-4 < told < 2.0 * error + 2e-3


def test_steps_come_from_the_readings() -> None:
    recording = small_recording(robots=2)
    assert steps_of(recording, 5.0).force_N == 0.0  # continuous
    recording.tau[:] = np.round(recording.tau / 0.05) * 0.05
    coarse = steps_of(recording, 5.0)
    assert 0.2 < coarse.force_N < 0.4  # 0.05 N m at legs of 0.2 m
    recording.tau[:] = 1.5
    assert steps_of(recording, 5.0).force_N == pytest.approx(
        coarse.force_N / 5.0
    )  # 0.01 N m where none shows
    assert not coarse.still_rad2.any()
    recording.theta[:] = np.round(recording.theta / 0.01) * 0.01
    recording.theta[:, 1] = 0.12
    np.testing.assert_allclose(steps_of(recording, 5.0).still_rad2, [0.0, 0.01**2 / 12], atol=1e-12)


def test_tilts_that_rest_on_one_reading_make_grasps_uncertain() -> None:
    grasps = exact_grasps(make_body(3))
    rng, variances, found = np.random.default_rng(7), np.array([1e-6, 4e-6, 0.0]), []
    for _ in range(1000):
        first, *others = Rotation.from_rotvec(rng.normal(size=(3, 3)) * np.sqrt(variances)[:, None])
        errors = []
        for R, p, own in zip(grasps.R_1i[1:], grasps.p_1i[1:], others, strict=True):
            read = first.inv() * Rotation.from_matrix(R) * own
            errors += [*(Rotation.from_matrix(R) * read.inv()).as_rotvec(), *(p - first.inv().apply(p))]
        found.append(errors)
    expected = grasps.rounded(variances).covariance - grasps.covariance
    np.testing.assert_allclose(np.cov(np.transpose(found)), expected, atol=0.12 * expected.max())
