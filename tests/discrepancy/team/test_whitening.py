"""Whitening of noise with a known law: correlated channels, autoregressive in time."""

import numpy as np
import pytest
from scipy.signal import lfilter

from discrepancy.team.linear.rows import Whitening

MIX = np.array([[2.0, 0.0, 0.0], [0.3, 0.7, 0.0], [0.0, -3.0, 20.0]])
AR = (1.1, -0.4)  # x_t = 1.1 x_t-1 - 0.4 x_t-2 + e
ALONE = np.array([[0.3, 0.1, 0.0], [0.0, 1.0, 0.0], [0.4, 0.0, 5.0]])


def noise(rng, draws, moving, alone):
    """(draws, moving + alone, 3): an AR(2) series in every source, mixed; then independent rows."""
    white = rng.standard_normal((draws, moving + 200, 3))
    series = lfilter([1.0], [1.0, -AR[0], -AR[1]], white, axis=1)[:, 200:] @ MIX.T
    return np.concatenate([series, rng.standard_normal((draws, alone, 3)) @ ALONE.T], axis=1)


@pytest.fixture
def rng():
    return np.random.default_rng(5)


def each(white, x):
    return np.array([white(draw) for draw in x])


def test_noise_becomes_white_on_draws_that_it_has_not_seen(rng):
    white = Whitening.of(noise(rng, 60, 300, 100), 300)
    z = each(white, noise(rng, 60, 300, 100))
    for part, tolerance in ((z[:, 2:300], 0.07), (z[:, 300:], 0.07), (z[:, :2], 0.3)):
        rows = part.reshape(-1, 3)
        np.testing.assert_allclose(rows.T @ rows / len(rows), np.eye(3), atol=tolerance)
    moving = z[:, 2:300]
    for lag in (1, 2, 3, 5):
        np.testing.assert_allclose(np.mean(moving[:, lag:] * moving[:, :-lag], axis=(0, 1)), 0.0, atol=0.03)
    np.testing.assert_allclose(white.ar, np.tile(AR, (3, 1)), atol=0.03)
    variance = (1 + 0.4) / ((1 - 0.4) * ((1 + 0.4) ** 2 - 1.1**2))  # of a stationary AR(2), in innovations
    np.testing.assert_allclose(white.innovation, 1.0 / np.sqrt(variance), rtol=0.04)


def test_residual_and_columns_go_through_one_linear_map(rng):
    white = Whitening.of(noise(rng, 20, 100, 30), 100)
    x = rng.standard_normal((130, 3, 4))
    z = white(x)
    for k in range(4):
        np.testing.assert_allclose(white(x[..., k]), z[..., k], rtol=1e-12, atol=1e-13)
    weights = rng.standard_normal(4)
    np.testing.assert_allclose(white(x @ weights), z @ weights, rtol=1e-10, atol=1e-10)


def uneven_noise(rng, draws):
    """AR(2) noise whose first four rows are three times as loud in the first two channels before they are mixed."""
    white = lfilter([1.0], [1.0, -AR[0], -AR[1]], rng.standard_normal((draws, 360, 3)), axis=1)[:, 200:]
    white /= white[:, 10:].std()
    white[:, :4, :2] *= 3.0
    return white @ MIX.T


def test_loud_rows_weigh_less_and_leave_the_others_as_they_are(rng):
    draws = uneven_noise(rng, 24)
    even, white = Whitening.of(draws, 160), Whitening.of(draws, 160, uneven=True)
    new = uneven_noise(rng, 400)
    power, before = (np.mean(each(w, new) ** 2, axis=0) for w in (white, even))
    assert before[:3, :2].min() > 4.0
    assert before[10:].mean() < 0.96  # the loud rows are in what all are measured by
    np.testing.assert_allclose(power[10:].mean(axis=0), 1.0, atol=0.08)
    np.testing.assert_allclose(power[:4], 1.0, atol=1.2)  # a mean square of 24 draws
    np.testing.assert_allclose(power[:4].mean(), 1.0, atol=0.3)
    assert np.all(white.loudness[10:] == 1.0)
    assert np.all(white.loudness[:, 2] == 1.0)
