"""Clocks against motions evaluated at shifted times, against the simulator's delay, and by repeated noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimator.clocks import estimate_clocks
from mocobot_sim.scene.as_built import SensorEffects
from mocobot_sim.trial.sensors import PRESETS, measure
from turning_body import RATE_HZ, clocked, swaying, theta_at

ENCODER_RAD = 2 * np.pi / 2**16
ROUNDING_RAD = ENCODER_RAD / np.sqrt(12)


def noisy(theta, rng, std=ROUNDING_RAD):
    return [x + std * rng.standard_normal(x.shape) for x in theta]


# --- what an offset means


@pytest.mark.parametrize("delay_s", [0.0, 0.0017, -0.0123, 0.4])
def test_a_log_that_is_late_has_a_positive_offset(delay_s):
    """stamp = true time + offset: what is logged as of t was sampled at t - offset."""
    time = np.arange(3000) / RATE_HZ
    estimate = estimate_clocks([theta_at(time, 0), theta_at(time - delay_s, 1)], [0.0, 0.0], RATE_HZ)
    assert estimate.offset_s[1] == pytest.approx(delay_s, abs=1e-7)
    assert estimate.drift[1] == pytest.approx(0.0, abs=1e-8)
    assert (estimate.offset_s[0], estimate.drift[0]) == (0.0, 0.0)


@pytest.mark.parametrize("preset", ["ideal", "nominal"])
def test_the_simulators_delay_is_found(random_a, preset):
    delay_s = (0.0, 0.0042, -0.011)
    log = replace(random_a, sensors=SensorEffects(clock_delay_s=delay_s))
    seen = measure(log, PRESETS[preset], np.random.default_rng(1))
    theta = [seen.joints(i)[1] for i in range(3)]
    estimate = estimate_clocks(theta, np.full(3, seen.time[0]), seen.metadata.rate_hz)
    error = estimate.offset_s - delay_s
    assert np.all(np.abs(error[1:]) < 5 * estimate.offset_se_s[1:] + 2e-6)
    assert np.abs(error).max() < (5e-6 if preset == "ideal" else 5e-5)
    assert np.all(np.abs(estimate.drift[1:]) < 5 * estimate.drift_se[1:] + 5e-7)


def test_drift_and_offset_at_the_middle_whatever_the_stamps_begin_with():
    theta, starts = clocked(
        [0, 0.02, -3.1], [0, 5e-5, -4e-4], starts_s=[100.0, 100.3337, 96.0], duration_s=60.0
    )
    estimate = estimate_clocks(theta, starts, RATE_HZ)
    assert estimate.middle_s == pytest.approx(100.0 + 59.99 / 2)
    np.testing.assert_allclose(estimate.offset_s, [0, 0.02, -3.1], rtol=0, atol=2e-7)
    np.testing.assert_allclose(estimate.drift, [0, 5e-5, -4e-4], rtol=0, atol=1e-8)
    np.testing.assert_allclose(
        estimate.stamps(2, [100.0, estimate.middle_s]),
        [100 - 3.1 + 4e-4 * 29.995, estimate.middle_s - 3.1],
        atol=3e-7,
    )


def test_one_axis_is_enough():
    """Then R_1i is open, and none of the clocks' business."""

    def rocking(time):
        return Rotation.from_rotvec(
            np.multiply.outer(0.1 * np.sin(2 * time) + 0.05 * np.sin(3.1 * time), [0.6, 0, 0.8])
        )

    theta, starts = clocked([0, 0.031], [0, 2e-5], motion=rocking)
    for angles, tolerance in ((theta, 1e-7), (noisy(theta, np.random.default_rng(4)), 1e-4)):
        estimate = estimate_clocks(angles, starts, RATE_HZ)
        assert estimate.offset_s[1] == pytest.approx(0.031, abs=tolerance)
        assert estimate.drift[1] == pytest.approx(2e-5, abs=tolerance / 10)


# --- standard errors


@pytest.mark.slow
@pytest.mark.parametrize("shade", ["white", "slow"])
def test_standard_errors_hold(shade):
    """The same motion again and again with new noise: what is claimed is what is found."""
    rng = np.random.default_rng(5)
    theta, starts = clocked([0, 0.004, -0.02], [0, 3e-5, 0], duration_s=30.0)
    z = []
    for _ in range(24):
        noise = [1e-4 * rng.standard_normal((len(x) + 50, 3)) for x in theta]
        if shade == "slow":  # 0.2 s of correlation
            noise = [np.apply_along_axis(np.convolve, 0, x, np.full(20, 0.2), "same") for x in noise]
        estimate = estimate_clocks(
            [x + e[: len(x)] for x, e in zip(theta, noise, strict=True)], starts, RATE_HZ
        )
        z.append(
            [
                *(estimate.offset_s - [0, 0.004, -0.02])[1:] / estimate.offset_se_s[1:],
                *(estimate.drift - [0, 3e-5, 0])[1:] / estimate.drift_se[1:],
            ]
        )
    rms = np.sqrt(np.mean(np.square(z), axis=0))
    np.testing.assert_array_less(rms, 1.5)
    np.testing.assert_array_less(0.65, rms)
    assert np.sqrt(np.mean(np.square(z))) == pytest.approx(1.0, abs=0.2)


# --- what cannot be told


def still(time):
    return Rotation.from_rotvec(np.multiply.outer(np.ones_like(time), [0.02, -0.03, 0.05]))


def spinning(time):
    return Rotation.from_rotvec(np.multiply.outer(0.02 * (time - 20.0), [0.1, 0.2, 1.0]))


def coning(time):
    """Turns about an axis that itself turns evenly: a later moment is the same as another grasp."""
    about_z = Rotation.from_rotvec(np.multiply.outer(3.0 * time, [0.0, 0.0, 1.0]))
    return about_z * Rotation.from_rotvec([0.1, 0.0, 0.0]) * about_z.inv()


@pytest.mark.parametrize("std", [0.0, 1e-5, "encoder"])
@pytest.mark.parametrize("motion", [still, spinning, coning])
def test_even_motion_tells_nothing(motion, std):
    theta, starts = clocked([0, 0.01], [0, 0], motion=motion)
    if std == "encoder":
        theta = [np.round(x / ENCODER_RAD) * ENCODER_RAD for x in theta]
    else:
        theta = noisy(theta, np.random.default_rng(6), std)
    estimate = estimate_clocks(theta, starts, RATE_HZ)
    assert not estimate.determined
    assert np.isnan(estimate.offset_s[1])
    assert np.isnan(estimate.offset_se_s[1])
    assert estimate.why_not[0] is None
    assert "hardly turns" in estimate.why_not[1] or "changes too little, too evenly" in estimate.why_not[1]


def test_robots_that_hold_different_bodies():
    theta, starts = clocked([0, 0], [0, 0])
    theta[1] = theta_at(np.arange(4000) / RATE_HZ, 1, lambda t: swaying(1.3 * t + 500.0))
    estimate = estimate_clocks(theta, starts, RATE_HZ)
    assert "not alike at both grasps" in estimate.why_not[1]
    assert estimate.mismatch[1] > 0.5


def test_one_robot_has_the_time():
    theta, starts = clocked([0], [0])
    estimate = estimate_clocks(theta, starts, RATE_HZ)
    assert (estimate.determined, estimate.why_not, estimate.reports) == (True, (None,), ())


def test_a_motion_that_repeats_itself():
    def periodic(time):
        wave = np.stack(
            [
                0.06 * np.sin(np.pi * time) + 0.03 * np.sin(2 * np.pi * time),
                0.04 * np.cos(2 * np.pi * time),
                0.03 * np.sin(np.pi * time + 1),
            ]
        )
        return Rotation.from_rotvec(wave.T)

    theta, starts = clocked([0, 0.8], [0, 0], motion=periodic)
    estimate = estimate_clocks(noisy(theta, np.random.default_rng(8)), starts, RATE_HZ)
    assert estimate.offset_s[1] == pytest.approx(0.8, abs=1e-4)
    assert estimate.repeats_s[1] == pytest.approx(2.0, abs=1e-3)
    free = estimate_clocks(*clocked([0, 0.8], [0, 0]), RATE_HZ)
    assert np.isnan(free.repeats_s[1])


# --- the search
