"""Columns made of noisy torques: unbiased once the torques are adjusted to the payload's motion."""

from dataclasses import replace

import numpy as np
import pytest

from discrepancy.least_squares.whitening import Whitening
from discrepancy.team.causes import CAUSES
from discrepancy.team.linear.adjust import TorqueNoise, with_adjusted_torques
from discrepancy.team.linear.noise import Noise
from discrepancy.team.linear.signals import with_rates
from discrepancy.team.linear.start import noise_rows
from estimator.rigid_team.residual import balance, grasp_data
from team_case import DESIGN, exact, residual_of

DRAWS = 12


@pytest.fixture(scope="module")
def case():
    return exact()


@pytest.fixture(scope="module")
def noise():
    sigma = np.array([1.2e-5, 1.2e-5, 0.02])[:, None, None] * np.ones((3, 3, 3))
    return Noise(np.zeros((3, 3, 3)), sigma)


def measured(case, noise, rng):
    """The trial as noisy sensors see it, linearised where the exact one is."""
    errors = next(noise.draws(case.signals, rng, 1))
    signals = case.signals.minus(-errors.phi, -errors.theta, -errors.tau)
    rate = signals.rate_hz
    parts = with_rates(signals.phi, rate), with_rates(signals.theta, rate), with_rates(signals.tau, rate)[:1]
    s = np.concatenate(parts).transpose(1, 2, 0, 3).reshape(len(signals.time), 3, 21)
    # What the filters bend is no noise.
    residual = residual_of(case, signals) - case.linear.residual
    return replace(case.linear, signals=signals, s=s, data=grasp_data(s, DESIGN, rate), residual=residual)


def common_scale(linear, white):
    """Least squares of one scale of all springs beside all unknowns."""
    scale = sum(CAUSES["sea_scale"].columns(linear, i, k, {}) for i in range(3) for k in range(3))
    columns = white(np.concatenate([linear.by_shared, linear.by_bases, scale], axis=2))
    columns = columns.reshape(-1, columns.shape[2])
    size = np.linalg.norm(columns, axis=0)
    return np.linalg.lstsq(columns / size, white(linear.residual).ravel(), rcond=None)[0][-1] / size[-1]


@pytest.mark.slow
def test_the_scale_of_all_springs_is_unbiased(case, noise):
    """Noise alone: with the torques as measured it imitates a scale, with the adjusted ones it does not."""
    rng = np.random.default_rng(6)
    rows, torques = noise_rows(case.linear, noise, rng)
    moving = case.reduction.moving
    white, torque_noise = Whitening.of(rows, moving), TorqueNoise.of(rows, torques, moving)
    raw, adjusted = [], []
    for _ in range(DRAWS):
        linear = measured(case, noise, rng)
        raw.append(common_scale(linear, white))
        adjusted.append(common_scale(with_adjusted_torques(linear, torque_noise), white))

    def far(values):
        """Mean over its standard error."""
        return np.mean(values) / (np.std(values, ddof=1) / np.sqrt(DRAWS))

    assert far(raw) < -5.0
    assert abs(far(adjusted)) < 3.0
    assert abs(np.mean(adjusted)) < 0.25 * abs(np.mean(raw))


def test_torques_are_moved_as_little_as_balances_the_wrenches(case, noise):
    """Torque noise alone: the smallest weighted change, by least squares at one instant."""
    t, rng = case.reduction.sample[40], np.random.default_rng(2)
    only = Noise(noise.step, noise.sigma * np.array([0.0, 0.0, 1.0])[:, None, None])
    linear = measured(case, only, rng)
    J = np.concatenate([linear.J.dense()[i, t, -6:, 18:] for i in range(3)], axis=1)  # (6, 9)
    variance = rng.uniform(1.0, 2.0, 9)
    information = np.linalg.inv(J @ np.diag(variance) @ J.T)
    torque_noise = TorqueNoise((variance.reshape(3, 3), np.zeros((3, 3))), (information, np.zeros((6, 6))))
    adjusted = with_adjusted_torques(linear, torque_noise)
    left, before = (balance(grasp_data(x.s, DESIGN, 100.0), case.shared)[0][t] for x in (adjusted, linear))
    assert np.linalg.norm(left) < 1e-3 * np.linalg.norm(before)
    root = np.sqrt(variance)
    smallest = root * np.linalg.lstsq(J * root, -before, rcond=None)[0]
    np.testing.assert_allclose((adjusted.s - linear.s)[t, :, 18:].ravel(), smallest, atol=1e-9)
    np.testing.assert_array_equal(adjusted.s[:, :, :18], linear.s[:, :, :18])


def test_holds_have_a_noise_of_their_own():
    """Variance and information of moving rows and of holds are those of their own draws; none where there are none."""
    rng = np.random.default_rng(3)
    rows, torques = rng.standard_normal((400, 30, 12)), rng.standard_normal((400, 30, 2, 3))
    rows[:, 20:] *= 3.0
    torques[:, 20:] *= 0.5
    found = TorqueNoise.of(rows, torques, 20)
    np.testing.assert_allclose(found.information[0], np.eye(6), atol=0.06)
    np.testing.assert_allclose(found.information[1], np.eye(6) / 9.0, atol=0.01)
    np.testing.assert_allclose(found.variance[0], 1.0, atol=0.06)
    np.testing.assert_allclose(found.variance[1], 0.25, atol=0.02)
    without = TorqueNoise.of(rows[:, :20], torques[:, :20], 20)
    assert not without.information[1].any()
    assert not without.variance[1].any()
