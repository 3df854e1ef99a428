"""Dense columns and patches as one set of columns, against the same as whole arrays."""

import numpy as np
import pytest

from discrepancy.least_squares.gram import gram_of, orthonormal
from discrepancy.team.linear.patches import Patches
from discrepancy.least_squares.span import Span
from patchwork import patchwork

N, C = 40, 5


@pytest.fixture
def rng():
    return np.random.default_rng(31)


@pytest.mark.parametrize("own", [0, 3])
def test_sums_and_products_are_those_of_whole_columns(rng, own):
    dense = orthonormal(rng.standard_normal((N, C, own)))
    cases = [
        patchwork(rng, N, C, [(0, 9), (5, 20)], [2, 3]),
        patchwork(rng, N, C, [(30, 38), (12, 33), (38, 40)], [3, 1, 4]),
    ]
    span, whole = Span(dense), dense
    np.testing.assert_array_equal(span.gram, np.eye(own))
    assert span.first == C
    for columns, part in cases:
        span, whole = span.beside(part), np.concatenate([whole, columns], axis=2)
        np.testing.assert_allclose(span.gram, gram_of(whole, whole), atol=1e-12)
        z, x = rng.standard_normal((whole.shape[2], 4)), rng.standard_normal((N, C, 2))
        np.testing.assert_allclose(span.times(z), whole @ z, atol=1e-12)
        np.testing.assert_allclose(span.times(z, 2), (whole @ z)[:, 2:], atol=1e-12)
        np.testing.assert_allclose(span.products(x), gram_of(whole, x), atol=1e-12)
    assert span.first == 1
    np.testing.assert_array_equal(whole[..., span.dense], dense)


def test_nothing_more_is_the_same(rng):
    """Of a trial in which a cause leaves nothing open."""
    dense = orthonormal(rng.standard_normal((N, C, 3)))
    _, part = patchwork(rng, N, C, [(4, 7)], [1])
    span = Span(dense).beside(Patches((N, C))).beside(part)
    np.testing.assert_array_equal(span.gram, Span(dense).beside(part).gram)
    assert span.first == 1
    z, x = rng.standard_normal((5, 4)), rng.standard_normal((N, C, 2))
    np.testing.assert_array_equal(span.times(z), Span(dense).beside(part).times(z))
    assert span.products(x).shape == (5, 2)
