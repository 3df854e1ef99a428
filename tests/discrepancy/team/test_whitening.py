"""Whitening of noise with a known law: correlated channels, autoregressive in time."""

import numpy as np
import pytest
from scipy.signal import lfilter

from discrepancy.team.linear.rows import Whitening, whitened

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


@pytest.mark.parametrize("parameters", [1, 3])
@pytest.mark.parametrize("rows", [3, 130])
def test_shapes_that_could_be_mixed_up(rng, rows, parameters):
    """As many rows or parameters as channels: still the channels are what is decorrelated."""
    white = Whitening.of(noise(rng, 20, 100, 30), 100) if rows > 3 else Whitening.of(noise(rng, 20, 0, 3), 0)
    x = rng.standard_normal((rows, 3, parameters))
    for k in range(parameters):
        np.testing.assert_allclose(white(x)[..., k], white(x[..., k]), rtol=1e-12, atol=1e-13)


def test_columns_that_a_shape_lacks_stay_nought(rng):
    white = Whitening.of(noise(rng, 20, 100, 30), 100)
    columns = rng.standard_normal((130, 3, 4))
    for lacking in ([], [0, 2], [0, 1, 2, 3]):
        columns[..., lacking] = 0.0
        z = whitened(white, columns)
        np.testing.assert_allclose(z, white(columns), rtol=1e-12, atol=1e-13)
        np.testing.assert_array_equal(z[..., lacking], 0.0)


def test_map_by_hand(rng):
    white = Whitening.of(noise(rng, 50, 60, 10), 60)
    x = rng.standard_normal((70, 3))
    moving = np.array([np.linalg.solve(white.chol_moving, row) for row in x[:60]])
    expected = moving.copy()
    for q in range(2, 60):
        past = white.ar[:, 0] * moving[q - 1] + white.ar[:, 1] * moving[q - 2]
        expected[q] = (moving[q] - past) / white.innovation
    alone = np.array([np.linalg.solve(white.chol_alone, row) for row in x[60:]])
    np.testing.assert_allclose(white(x), np.concatenate([expected, alone]), rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(white.rows_only(x), np.concatenate([moving, alone]), rtol=1e-10, atol=1e-10)


def test_rows_that_stand_alone_know_nothing_of_the_series(rng):
    draws = noise(rng, 50, 60, 10)
    white = Whitening.of(draws, 60)
    x = rng.standard_normal((70, 3))
    changed = x.copy()
    changed[:60] += 1.0
    np.testing.assert_array_equal(white(x)[60:], white(changed)[60:])
    changed = x.copy()
    changed[60:] += 1.0
    np.testing.assert_array_equal(white(x)[:60], white(changed)[:60])


@pytest.mark.parametrize(("moving", "alone"), [(0, 30), (30, 0), (10, 5), (0, 1), (3, 0), (21, 1)])
def test_few_rows(rng, moving, alone):
    draws = noise(rng, 24, moving, alone)
    z = Whitening.of(draws, moving)(draws[0])
    assert z.shape == (moving + alone, 3)
    assert np.all(np.isfinite(z))


def test_fewer_rows_than_channels_stay_of_unit_variance(rng):
    """Forty channels from six rows: each keeps its own variance, none of their chance correlations blows up."""
    scale = np.geomspace(1e-4, 1e2, 40)
    seen = rng.standard_normal((2, 3, 40)) * scale
    z = each(Whitening.of(seen, 0), rng.standard_normal((150, 3, 40)) * scale)
    assert np.all(np.isfinite(z))
    # The variances themselves are known from six numbers each: chi-square of six degrees of freedom.
    expected = 1.0 / np.mean((seen / scale) ** 2, axis=(0, 1))
    np.testing.assert_allclose(np.mean(z**2, axis=(0, 1)), expected, rtol=0.25)


def test_channel_that_never_moves(rng):
    draws = noise(rng, 24, 60, 10)
    draws[..., 1] = 0.0
    white = Whitening.of(draws, 60)
    z = each(white, draws)
    assert np.all(np.isfinite(z))
    np.testing.assert_array_equal(z[..., 1], 0.0)
    others = z[:, 2:60][..., [0, 2]].reshape(-1, 2)
    np.testing.assert_allclose(np.std(others, axis=0), 1.0, atol=0.1)


def test_as_many_series_rows_as_channels(rng):
    """Moving rows and channels of one number, as a large team may have: channels are decorrelated, not rows."""
    scale = np.geomspace(1e-3, 1e3, 24)
    draws = rng.standard_normal((60, 24, 24)) * scale
    z = each(Whitening.of(draws, 24), draws)
    np.testing.assert_allclose(np.std(z, axis=(0, 1)), 1.0, atol=0.15)
    lagged = Whitening.of(draws, 24)
    np.testing.assert_allclose(lagged.ar, 0.0, atol=0.15)
    np.testing.assert_allclose(lagged.innovation, 1.0, atol=0.1)


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


def test_even_noise_has_no_loud_rows(rng):
    draws = noise(rng, 24, 300, 30)
    even, white = Whitening.of(draws, 300), Whitening.of(draws, 300, uneven=True)
    assert np.mean(white.loudness > 1.0) < 0.003
    x = rng.standard_normal((330, 3))
    quiet = np.all(white.loudness == 1.0, axis=1)
    np.testing.assert_allclose(white(x)[:300][quiet], even(x)[:300][quiet], rtol=0.1, atol=0.1)


def test_where_most_rows_are_loud_somewhere_each_is_divided_by_its_own_noise(rng):
    """Every row but a few is loud in one channel of twelve: hardly any would be left if loud rows were left out."""
    scale = np.ones((48, 12))
    scale[np.arange(44), np.arange(44) % 12] = 6.0
    white = Whitening.of(scale * rng.standard_normal((24, 48, 12)), 48, uneven=True)
    power = np.mean(each(white, scale * rng.standard_normal((400, 48, 12))) ** 2, axis=0)
    assert power[scale > 1].mean() == pytest.approx(1.0, abs=0.15)
    assert power[scale == 1].mean() == pytest.approx(1.0, abs=0.15)
    np.testing.assert_array_equal(white.loudness[:44] > 1.0, scale[:44] > 1.0)
