"""Cells of noise: the transform is orthonormal, and octaves are where a sine of their frequency falls."""

import numpy as np
import pytest
from scipy.stats import chi2

from discrepancy.least_squares.cells import Cells, cosine_matrix
from discrepancy.least_squares.gram import orthonormal, project
from discrepancy.rules import CELL_BANDS
from linear_problem import cosines

RATE_HZ = 12.5


@pytest.fixture
def rng():
    return np.random.default_rng(7)


def test_transform_is_the_orthonormal_cosine_transform(rng):
    x = rng.standard_normal((40, 3, 5))
    given = x.copy()
    y = Cells.of(40, 3).spectrum(x)
    np.testing.assert_allclose(y, np.einsum("ki,icl->kcl", cosines(40), x), atol=1e-12)
    assert np.sum(y**2) == pytest.approx(np.sum(x**2), rel=1e-12)
    np.testing.assert_array_equal(x, given)  # it was not changed in place


def test_rows_that_stand_alone_stay(rng):
    x = rng.standard_normal((40, 2, 1))
    cells = Cells.of(40, 2, moving=33)
    y = cells.spectrum(x)
    np.testing.assert_array_equal(y[33:], x[33:])
    np.testing.assert_allclose(y[:33, 0, 0], cosines(33) @ x[:33, 0, 0], atol=1e-12)
    assert np.all(cells.index[33:] == CELL_BANDS)
    assert np.all(cells.index[:33] < CELL_BANDS)
    none = Cells.of(5, 2, moving=0)
    np.testing.assert_array_equal(none.spectrum(x[:5]), x[:5])
    assert np.all(none.index == CELL_BANDS)


@pytest.mark.parametrize(
    ("moving", "groups"), [(None, None), (30, [0, 0, 1]), (0, [2, 0, 1]), (40, [1, 1, 0])]
)
def test_gram_matrices_of_cells_add_up(rng, moving, groups):
    a, b = rng.standard_normal((40, 3, 4)), rng.standard_normal((40, 3, 2))
    cells = Cells.of(40, 3, moving, groups)
    parts = cells.grams(cells.spectrum(a), cells.spectrum(b))
    assert parts.shape == (len(cells.sizes), 4, 2)
    np.testing.assert_allclose(parts.sum(axis=0), a.reshape(120, 4).T @ b.reshape(120, 2), atol=1e-10)
    assert cells.sizes.sum() == 120
    assert not parts[cells.sizes == 0].any()


def test_groups_of_channels_share_no_cell(rng):
    x = rng.standard_normal((40, 3, 1))
    x[:, :2] = 0.0
    cells = Cells.of(40, 3, 30, [0, 0, 1])
    parts = cells.grams(cells.spectrum(x), cells.spectrum(x))[:, 0, 0]
    assert len(parts) == 2 * (CELL_BANDS + 1)
    assert not parts[: CELL_BANDS + 1].any()
    assert np.all(parts[CELL_BANDS + 1 :] > 0)


@pytest.mark.parametrize("octave", range(CELL_BANDS))
def test_sine_falls_into_its_octave(octave):
    """From the highest frequency that the rate allows down; below the last octave all is one cell."""
    frequency = 0.7 * RATE_HZ / 2.0 * 0.5**octave
    n = 1200
    time = np.arange(n) / RATE_HZ
    window = np.hanning(n)  # no jumps at the ends
    x = (window * np.sin(2 * np.pi * frequency * time + 0.4))[:, None, None]
    cells = Cells.of(n, 1)
    power = cells.grams(cells.spectrum(x), cells.spectrum(x))[:, 0, 0]
    assert power[CELL_BANDS - 1 - octave] > 0.99 * power.sum()


def test_slowest_of_all_are_in_the_first_cell():
    n = 1200
    drift = np.linspace(-1.0, 1.0, n)[:, None, None]
    cells = Cells.of(n, 1)
    assert cells.grams(cells.spectrum(drift), cells.spectrum(drift))[0, 0, 0] > 0.98 * np.sum(drift**2)


def test_white_noise_has_unit_power_in_every_cell(rng):
    cells = Cells.of(400, 6, 380, [0, 0, 0, 1, 1, 1])
    x = rng.standard_normal((400, 6, 1))
    left = cells.grams(cells.spectrum(x), cells.spectrum(x))[:, 0, 0]
    assert np.all(chi2.sf(left, cells.sizes) > 1e-4)
    assert np.all(chi2.cdf(left, cells.sizes) > 1e-4)


@pytest.mark.parametrize("rows", [1, 2, 101, 226, 446, 450, 887, 907])
def test_transforms_and_back_whatever_the_rows_are_divisible_by(rng, rows):
    """Against its definition; of rows with a large prime factor it is a product with a matrix."""
    assert (cosine_matrix(rows) is None) == (rows not in (101, 226, 446, 887))
    cells, x = Cells.of(rows + 3, 2, moving=rows), rng.standard_normal((rows + 3, 2, 3))
    y = cells.spectrum(x)
    np.testing.assert_allclose(y[:rows], np.einsum("ki,icl->kcl", cosines(rows), x[:rows]), atol=1e-12)
    np.testing.assert_array_equal(y[rows:], x[rows:])
    np.testing.assert_allclose(cells.series(y), x, atol=1e-12)


def test_numbers_that_unknowns_of_a_trial_leave_in_cells(rng):
    """The mean square of white noise without them, over draws, and all of a cell that they span."""
    cells = Cells.of(60, 2, 50, [0, 1])
    slow = np.zeros((60, 2, 5))
    slow[:50, 0] = np.vander(np.linspace(-1.0, 1.0, 50), 5)
    off = orthonormal(slow)
    left = cells.left_by(off)
    assert left.sum() == pytest.approx(115.0, abs=1e-9)
    assert left[0] < cells.sizes[0] - 1.0
    assert np.all(left[CELL_BANDS + 1 :] == cells.sizes[CELL_BANDS + 1 :])
    x = cells.spectrum(project(rng.standard_normal((60, 2, 4000)), off))
    squares = np.bincount(cells.index.ravel(), np.mean(x**2, axis=2).ravel(), minlength=len(left))
    # A mean of 4000 chi-squares of so many numbers.
    np.testing.assert_allclose(squares, left, atol=4.0 * np.sqrt(2.0 * left.max() / 4000))
    assert np.all(Cells.of(6, 1, 0).left_by(orthonormal(np.eye(6)[:, None])) == 0.0)
