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


def test_channel_that_never_moves(rng):
    draws = noise(rng, 24, 60, 10)
    draws[..., 1] = 0.0
    white = Whitening.of(draws, 60)
    z = each(white, draws)
    assert np.all(np.isfinite(z))
    np.testing.assert_array_equal(z[..., 1], 0.0)
    others = z[:, 2:60][..., [0, 2]].reshape(-1, 2)
    np.testing.assert_allclose(np.std(others, axis=0), 1.0, atol=0.1)
