"""Columns that are there for a while, against the same as whole arrays."""

import numpy as np
import pytest

from discrepancy.least_squares.gram import gram_of
from discrepancy.team.linear.patches import Patches
from discrepancy.team.linear.whitening import Whitening
from patchwork import patchwork

N, C, MOVING = 60, 5, 50


@pytest.fixture
def rng():
    return np.random.default_rng(31)


@pytest.fixture
def case(rng):
    return patchwork(rng, N, C, [(0, 9), (5, 20), (30, 55), (48, 60), (52, 60)], [2, 0, 3, 2, 4])


def test_sums_and_products(rng, case):
    whole, patches = case
    assert patches.width == 10
    assert patches.first == 0
    np.testing.assert_array_equal(patches.dense(), whole)
    x, z = rng.standard_normal((N, C, 3)), rng.standard_normal((10, 4))
    np.testing.assert_allclose(patches.times(z), whole @ z, atol=1e-12)
    np.testing.assert_allclose(patches.times(z, 3), (whole @ z)[:, 3:], atol=1e-12)
    np.testing.assert_allclose(patches.products(x), gram_of(whole, x), atol=1e-12)
    np.testing.assert_allclose(patches.cross(patches), gram_of(whole, whole), atol=1e-12)
    other_whole, other = patchwork(rng, N, C, [(3, 33), (59, 60)], [1, 3])
    np.testing.assert_allclose(patches.cross(other), gram_of(whole, other_whole), atol=1e-12)
    np.testing.assert_array_equal(patches.together(4).dense(), whole)
    assert len(patches.together(4).each) == 3


def test_rows_with_a_gap(rng, case):
    """Moving rows, and others after all of them, as whitening puts them together."""
    _, patches = case
    gap = np.zeros((N, C, 2))
    gap[[7, 8, 9, 50, 51, 58], 1:] = rng.standard_normal((6, C - 1, 2))
    one, x = Patches.of(gap), rng.standard_normal((N, C, 3))
    assert isinstance(patches.each[0].where, slice)
    assert not isinstance(one.each[0].where, slice)
    for a, b in ((one, patches), (patches, one), (one, one)):
        np.testing.assert_allclose(a.cross(b), gram_of(a.dense(), b.dense()), atol=1e-12)
    np.testing.assert_allclose(one.products(x[:, 1:], 1), gram_of(gap, x), atol=1e-12)
    np.testing.assert_array_equal(one.dense(), gap)


def test_as_few_columns_as_scatter_alike(rng, case):
    """Normal unknowns of size one have the same covariance; columns that others are made of are no more of them."""
    whole, patches = case
    twice = Patches.of(np.concatenate([whole[..., :2], whole[..., :2] @ rng.standard_normal((2, 3))], axis=2))
    both = patches.beside([twice])
    assert both.width == 15
    assert both.fewer().width == 12
    flat, few = (x.dense().reshape(N * C, -1) for x in (both, both.fewer()))
    np.testing.assert_allclose(few @ few.T, flat @ flat.T, atol=1e-9)


def test_whitened_as_whole_columns_are(rng, case):
    whole, patches = case
    draws = rng.standard_normal((24, N, C)) @ rng.standard_normal((C, C))
    draws[:, :4] *= 5.0  # louder
    draws[:, 1:MOVING] += 0.6 * draws[:, : MOVING - 1]
    white = Whitening.of(draws, MOVING, uneven=True)
    assert len(white.loudness) == MOVING
    assert np.abs(white.ar).max() > 0.1
    np.testing.assert_allclose(white.of_patches(patches).dense(), white(whole), atol=1e-12)
    together = white.of_patches(patches.together(4))
    np.testing.assert_allclose(together.dense(), white(whole), atol=1e-12)
