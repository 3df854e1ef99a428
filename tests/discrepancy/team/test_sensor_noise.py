"""Resolution of the sensors from their recordings, and draws of their errors against really rounded signals."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from discrepancy.team.linear.noise import (
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
