"""Resolution of the sensors from their recordings, and draws of their errors against really rounded signals."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from discrepancy.team.linear.noise import (
    MODEL_ABOVE,
    MODEL_BELOW_HZ,
    MODEL_PHI_RAD,
    MODEL_TAU_NM,
    MODEL_THETA_RAD,
    Fast,
    Noise,
    chattering,
)
from discrepancy.team.linear.signals import Signals

RATE = 100.0
SAMPLES = 3000
TIME = np.arange(SAMPLES) / RATE


def sway(rng, amplitude, low=0.1, high=0.7):
    """Smooth motion of two robots, shape (Q, 2, 3)."""
    out = np.zeros((SAMPLES, 2, 3))
    for _ in range(4):
        frequency, phase = rng.uniform(low, high, (2, 3)), rng.uniform(0, 2 * np.pi, (2, 3))
        out += amplitude / 2 * np.sin(2 * np.pi * frequency * TIME[:, None, None] + phase)
    return out


def read(x, step, sigma, rng, grid=0.0):
    """A sensor that adds white noise and rounds, on a grid of its own."""
    noisy = x + sigma * rng.standard_normal(x.shape)
    return noisy if step == 0 else np.round((noisy - grid) / step) * step + grid


def trial(rng, angle=(0.0, 0.0), torque=(0.0, 0.0)):
    phi, theta, tau = (sway(rng, a) for a in (0.3, 0.2, 3.0))
    grid = rng.uniform(-1e-3, 1e-3)
    return Signals(
        TIME,
        read(phi, *angle, rng, grid),
        read(theta, *angle, rng, grid),
        read(tau, *torque, rng, grid),
        RATE,
    )


@pytest.fixture
def rng():
    return np.random.default_rng(77)


@pytest.mark.parametrize("bits", [12, 14, 16])
@pytest.mark.parametrize("sigma_steps", [0.0, 0.5])
def test_step_and_noise_of_rounded_angles(rng, bits, sigma_steps):
    step = 2 * np.pi / 2**bits
    noise = Noise.of([trial(rng, (step, sigma_steps * step)) for _ in range(2)])
    np.testing.assert_allclose(noise.step[:2], step, rtol=1e-6)
    # White noise above 25 Hz tells noise and rounding errors together; the latter are taken off again.
    total = np.sqrt(noise.sigma[:2] ** 2 + step**2 / 12)
    expected = np.hypot(sigma_steps * step, step / np.sqrt(12))
    np.testing.assert_allclose(total, expected, rtol=0.3)
    np.testing.assert_array_equal(noise.step[2], 0.0)


@pytest.mark.parametrize("sigma", [5e-5, 1e-3])
def test_continuous_angles(rng, sigma):
    noise = Noise.of([trial(rng, (0.0, sigma), (0.0, 0.05))])
    np.testing.assert_array_equal(noise.step, 0.0)
    for found, expected in ((noise.sigma[:2], sigma), (noise.sigma[2], 0.05)):
        np.testing.assert_allclose(found, expected, rtol=0.15)
        assert np.mean(found) == pytest.approx(expected, rel=0.07)


def test_grid_finer_than_motion_shows_at_rest_only(rng):
    """Of 20 bits hardly two samples in motion agree: as good as continuous, unless the joints rest for a while."""
    step = 2 * np.pi / 2**20
    moving = trial(rng, (step, 0.0))
    noise = Noise.of([moving])
    np.testing.assert_array_equal(noise.step[:2], 0.0)
    np.testing.assert_allclose(noise.sigma[:2], step / np.sqrt(12), rtol=0.1)
    phi, theta = moving.phi.copy(), moving.theta.copy()
    for x in (phi, theta):
        x[1000:2500] = x[1000]
    np.testing.assert_allclose(
        Noise.of([Signals(TIME, phi, theta, moving.tau, RATE)]).step[:2], step, rtol=1e-6
    )


def test_exact_sensors_leave_what_the_model_leaves(rng):
    """The model's own errors are drawn besides: white below a cut-off, little above it; the same at rest."""
    exact = trial(rng)
    noise = Noise.of([exact])
    np.testing.assert_allclose(noise.sigma, 0.0, atol=1e-9)
    errors = next(noise.draws(exact, rng, 1))
    for found, floor in (
        (errors.phi, MODEL_PHI_RAD),
        (errors.theta, MODEL_THETA_RAD),
        (errors.tau, MODEL_TAU_NM),
    ):
        power = np.mean(np.abs(np.fft.rfft(found, axis=0)) ** 2, axis=(1, 2)) / SAMPLES
        hz = np.fft.rfftfreq(SAMPLES, 1.0 / RATE)
        assert np.mean(power[hz < 0.7 * MODEL_BELOW_HZ]) == pytest.approx(floor**2 * RATE / 100.0, rel=0.15)
        assert np.mean(power[hz > 2.0 * MODEL_BELOW_HZ]) == pytest.approx((MODEL_ABOVE * floor) ** 2, rel=0.1)
    still = Signals(
        TIME, *(np.tile(x[:1], (SAMPLES, 1, 1)) for x in (exact.phi, exact.theta, exact.tau)), RATE
    )
    errors = next(noise.draws(still, rng, 1))
    np.testing.assert_array_less(np.std(errors.phi, axis=0), 0.01 * MODEL_PHI_RAD)
    assert np.any(np.abs(errors.phi) > 0.2 * MODEL_PHI_RAD)


def test_torques_may_be_rounded_too(rng):
    noise = Noise.of([trial(rng, (2 * np.pi / 2**16, 0.0), (0.02, 0.02))])
    np.testing.assert_allclose(noise.step[2], 0.02, rtol=1e-6)
    np.testing.assert_allclose(
        np.sqrt(noise.sigma[2] ** 2 + 0.02**2 / 12), np.hypot(0.02, 0.02 / np.sqrt(12)), rtol=0.1
    )


def test_every_trial_may_have_a_grid_of_its_own(rng):
    step = 2 * np.pi / 2**14
    noise = Noise.of([trial(rng, (step, 0.0)) for _ in range(5)])
    np.testing.assert_allclose(noise.step[:2], step, rtol=1e-6)


def smoothed(x):
    """The rows' band: below 5 Hz."""
    return sosfiltfilt(butter(3, 5.0, fs=RATE, output="sos"), x, axis=0)


@pytest.mark.parametrize("sigma_steps", [0.0, 0.4])
def test_draws_have_the_variance_of_real_rounding_in_motion(rng, sigma_steps):
    step = 2 * np.pi / 2**16
    true = sway(rng, 0.3)
    real, drawn = [], []
    noise = Noise(np.full((3, 2, 3), step), np.full((3, 2, 3), sigma_steps * step))
    for _ in range(12):
        recorded = read(true, step, sigma_steps * step, rng, rng.uniform(0, step, (2, 3)))
        real.append(recorded - true)
        errors = next(noise.draws(Signals(TIME, recorded, recorded, recorded, RATE), rng, 1))
        drawn += [errors.phi, errors.theta]
    for part in (lambda x: x, smoothed):
        a, b = (np.std([part(x)[200:-200] for x in group]) for group in (real, drawn))
        assert b == pytest.approx(a, rel=0.1)


@pytest.mark.parametrize("sigma_steps", [0.0, 0.4])
def test_draws_have_the_variance_of_real_rounding_at_rest(rng, sigma_steps):
    """A resting encoder repeats one rounding error: its mean over a hold varies by step / sqrt(12)."""
    step = 2 * np.pi / 2**14
    noise = Noise(np.full((3, 2, 3), step), np.full((3, 2, 3), sigma_steps * step))
    real, drawn = [], []
    for _ in range(60):
        true = np.tile(rng.uniform(0.2, 0.9, (2, 3)), (SAMPLES, 1, 1))
        recorded = read(true, step, sigma_steps * step, rng)
        real.append(recorded - true)
        errors = next(noise.draws(Signals(TIME, recorded, recorded, recorded, RATE), rng, 1))
        drawn += [errors.phi, errors.theta]
    means = [np.std([x.mean(axis=0) for x in group]) for group in (real, drawn)]
    whole = [np.std(group) for group in (real, drawn)]
    if sigma_steps == 0.0:
        assert means[0] == pytest.approx(step / np.sqrt(12), rel=0.1)
        assert means[1] == pytest.approx(means[0], rel=0.12)
        assert whole[1] == pytest.approx(whole[0], rel=0.12)
    else:
        assert whole[1] == pytest.approx(whole[0], rel=0.12)


def test_draws_of_continuous_channels_are_white(rng):
    noise = Noise(np.zeros((3, 2, 3)), np.full((3, 2, 3), 0.01))
    errors = next(noise.draws(trial(rng), rng, 1))
    assert np.std(errors.tau) == pytest.approx(0.01, rel=0.05)
    x = errors.phi.reshape(SAMPLES, 6)
    assert np.max(np.abs(np.mean(x[1:] * x[:-1], axis=0))) < 0.1 * 0.01**2
    assert np.corrcoef(errors.phi.ravel(), errors.theta.ravel())[0, 1] == pytest.approx(0.0, abs=0.05)


@pytest.mark.parametrize("hz", [29.7, 41.0])
def test_a_joint_that_chatters_is_not_taken_for_a_noisy_sensor(rng, hz):
    step = sigma = 0.01
    calm = trial(rng, torque=(0.0, 0.0))
    tau = calm.tau.copy()
    tau[:, 1, 2] += 5.0 * np.sin(2 * np.pi * hz * TIME)
    loud = Signals(TIME, calm.phi, calm.theta, read(tau, step, sigma, rng), RATE)
    noise = Noise.of([loud])
    # A periodic signal meets the grid at the same phases again: some of its rounding is in lines, too.
    total = np.hypot(noise.sigma[2], noise.step[2] / np.sqrt(12))
    np.testing.assert_allclose(total, np.hypot(sigma, step / np.sqrt(12)), rtol=0.15)
    said = Fast.of(loud).lines
    assert said[2, 1, 2] == pytest.approx(5.0 / np.sqrt(2), rel=0.01)
    said[2, 1, 2] = 0.0
    assert not said[2].any()


def test_what_is_said_of_a_joint_that_chatters(rng):
    calm = trial(rng, torque=(0.01, 0.01))
    tau = calm.tau.copy()
    tau[:, 0, 1] += 2.0 * np.sin(2 * np.pi * 35.0 * TIME)
    loud = Signals(TIME, calm.phi, calm.theta, tau, RATE)

    def said_of(*trials):
        noise = Noise.of(list(trials))
        return chattering([noise.known_to(one) for one in trials])

    assert said_of(calm) == ()
    (said,) = said_of(calm, loud)
    assert "driven joint 2 of robot 1 oscillates faster than 25 Hz, with 1.4 N m rms" in said
    small = replace(loud, tau=calm.tau + 0.04 * (tau - calm.tau))
    assert said_of(small) == ()


def test_channels_have_resolutions_of_their_own(rng):
    x = trial(rng)
    step = 2 * np.pi / 2**14
    phi = x.phi.copy()
    phi[:, 1, 2] = np.round(phi[:, 1, 2] / step) * step
    phi[:, 0, 0] += 1e-3 * rng.standard_normal(SAMPLES)
    noise = Noise.of([Signals(TIME, phi, x.theta, x.tau, RATE)])
    expected = np.zeros((2, 3))
    expected[1, 2] = step
    np.testing.assert_allclose(noise.step[0], expected, rtol=1e-6)
    assert noise.sigma[0, 0, 0] == pytest.approx(1e-3, rel=0.1)
    assert noise.sigma[0, 0, 1] == pytest.approx(0.0, abs=1e-9)
    errors = next(noise.draws(Signals(TIME, phi, x.theta, x.tau, RATE), rng, 1))
    assert np.std(errors.phi[:, 0, 0]) == pytest.approx(1e-3, rel=0.1)
    assert np.std(errors.phi[:, 0, 1]) < MODEL_PHI_RAD
