"""Columns that are there for a while, against the same as whole arrays."""

import numpy as np
import pytest

from discrepancy.team.linear.rows import Patches, Whitening
from patchwork import dense, patchwork

N, C, MOVING = 60, 5, 50


@pytest.fixture
def rng():
    return np.random.default_rng(31)


@pytest.fixture
def case(rng):
    return patchwork(rng, N, C, [(0, 9), (5, 20), (30, 55), (48, 60), (52, 60)], [2, 0, 3, 2, 4])


def test_as_few_columns_as_scatter_alike(rng, case):
    """Normal unknowns of size one have the same covariance; columns that others are made of are no more of them."""
    whole, patches = case
    np.testing.assert_array_equal(dense(patches.together(4)), whole)
    twice = Patches.of(np.concatenate([whole[..., :2], whole[..., :2] @ rng.standard_normal((2, 3))], axis=2))
    both = patches.beside([twice])
    assert both.width == 15
    assert both.fewer().width == 12
    flat, few = (dense(x).reshape(N * C, -1) for x in (both, both.fewer()))
    np.testing.assert_allclose(few @ few.T, flat @ flat.T, atol=1e-9)


def test_whitened_as_whole_columns_are(rng, case):
    whole, patches = case
    draws = rng.standard_normal((24, N, C)) @ rng.standard_normal((C, C))
    draws[:, :4] *= 5.0  # louder
    draws[:, 1:MOVING] += 0.6 * draws[:, : MOVING - 1]
    white = Whitening.of(draws, MOVING, uneven=True)
    assert len(white.loudness) == MOVING
    assert np.abs(white.ar).max() > 0.1
    for some in (patches, patches.together(4)):
        np.testing.assert_allclose(dense(white.of_patches(some)), white(whole), atol=1e-12)
