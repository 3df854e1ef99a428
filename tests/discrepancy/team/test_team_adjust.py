"""Columns made of noisy signals: unbiased once these are adjusted to closed loops and balanced wrenches."""

from dataclasses import replace

import numpy as np
import pytest

from discrepancy.team.causes import CAUSES
from discrepancy.team.linear.noise import Noise
from discrepancy.team.linear.rows import Whitening
from discrepancy.team.linear.start import SignalNoise, noise_rows, with_adjusted_signals
from discrepancy.team.linear.trial_linear import by_bases, by_shared, filtered
from estimator.rigid_team import balance, grasp_data
from team_case import DESIGN, every_sample, exact, residual_of

DRAWS = 12


@pytest.fixture(scope="module")
def case():
    return exact()


def noise_of(phi, theta, tau):
    sigma = np.array([phi, theta, tau])[:, None, None] * np.ones((3, 3, 3))
    return Noise(np.zeros((3, 3, 3)), sigma)


FINE, COARSE = noise_of(1.2e-5, 1.2e-5, 0.02), noise_of(4.4e-4, 4.4e-4, 5e-3)
"""Of 17 bits with noisy torques, and of 12 bits, whose accelerations are noisier than any torque."""


def measured(case, noise, rng):
    """The trial as noisy sensors see it, linearised where the exact one is."""
    errors = next(noise.draws(case.signals, rng, 1))
    signals = case.signals.minus(-errors.phi, -errors.theta, -errors.tau)
    s, rate = filtered(signals), signals.rate_hz
    # What the filters bend is no noise.
    residual = residual_of(case, signals) - case.linear.residual
    data = grasp_data(s, DESIGN, rate)
    columns = {
        "by_shared": case.reduction(by_shared(data, case.shared, case.bases)),
        "by_bases": case.reduction(by_bases(data, case.shared, case.bases)),
    }
    return replace(case.linear, signals=signals, s=s, data=data, residual=residual, **columns)


def of_all_springs(linear):
    """Columns of one scale of all springs."""
    return sum(CAUSES["sea_scale"].columns(linear, i, k, {}) for i in range(3) for k in range(3))


def of_all_lengths(linear):
    """Columns of one scale of all robots, which the loops cannot tell from a smaller payload."""
    lengths = DESIGN.proximal_length_m, DESIGN.rod_length_m, DESIGN.base_radius_m - DESIGN.platform_radius_m
    legs = [CAUSES["link_length"].columns(linear, i, k, {}) for i in range(3) for k in range(3)]
    return sum(legs) @ np.array(lengths)[:, None]


def common_scales(linear, white):
    """Least squares of one scale of all springs and one of all lengths beside all unknowns."""
    scales = [of_all_springs(linear), of_all_lengths(linear)]
    columns = white(np.concatenate([linear.by_shared, linear.by_bases, *scales], axis=2))
    columns = columns.reshape(-1, columns.shape[2])
    size = np.linalg.norm(columns, axis=0)
    return np.linalg.lstsq(columns / size, white(linear.residual).ravel(), rcond=None)[0][-2:] / size[-2:]


@pytest.mark.slow
@pytest.mark.parametrize("noise", [FINE, COARSE], ids=["fine", "coarse"])
def test_scales_of_all_are_unbiased(case, noise):
    """Noise alone: with the signals as measured it imitates a scale, with the adjusted ones it does not."""
    rng = np.random.default_rng(6)
    rows, errors = noise_rows(case.linear, noise, rng)
    moving = case.reduction.moving
    white, told = Whitening.of(rows, moving), SignalNoise.of(rows, errors, moving)
    raw, adjusted = [], []
    for _ in range(DRAWS):
        linear = measured(case, noise, rng)
        raw.append(common_scales(linear, white))
        adjusted.append(common_scales(with_adjusted_signals(linear, told), white))

    def far(values):
        """Mean over its standard error."""
        return np.mean(values, axis=0) / (np.std(values, axis=0, ddof=1) / np.sqrt(DRAWS))

    biased = np.abs(far(raw)) > 5.0  # coarse encoders bury what the lengths are off
    assert biased[0]
    assert biased[1] or noise is COARSE
    assert np.abs(far(adjusted)).max() < 3.0
    assert np.all(np.abs(np.mean(adjusted, axis=0)) < 0.25 * np.abs(np.mean(raw, axis=0)), where=biased)


FORCE, MOMENT = slice(-6, -3), slice(-3, None)


def test_torques_are_moved_as_little_as_balances_the_wrenches(case):
    """Torque noise alone: the smallest weighted change, by least squares at one instant."""
    t, rng = case.reduction.sample[40], np.random.default_rng(2)
    linear = measured(case, noise_of(0.0, 0.0, 0.02), rng)
    J = np.concatenate([every_sample(linear.J)[i, t, -6:, 18:] for i in range(3)], axis=1)  # (6, 9)
    root = np.sqrt(rng.uniform(1.0, 2.0, 9))
    torques = root * rng.standard_normal((1, 200_000, 9))
    errors = np.zeros((1, 200_000, 3, 21))
    errors[..., 18:] = torques.reshape(1, -1, 3, 3)
    rows = np.concatenate([np.zeros((1, 200_000, 12)), torques @ J.T], axis=2)
    adjusted = with_adjusted_signals(linear, SignalNoise.of(rows, errors, 200_000))
    left, before = (balance(grasp_data(x.s, DESIGN, 100.0), case.shared)[0][t] for x in (adjusted, linear))
    assert np.linalg.norm(left) < 1e-3 * np.linalg.norm(before)
    smallest = root * np.linalg.lstsq(J * root, -before, rcond=None)[0]
    moved = (adjusted.s - linear.s)[t, :, 18:].ravel()
    np.testing.assert_allclose(moved, smallest, atol=0.01 * np.abs(smallest).max())
    np.testing.assert_array_equal(adjusted.s[:, :, :18], linear.s[:, :, :18])
