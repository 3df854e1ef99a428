"""Cross products and matrices times vectors against numpy's."""

from __future__ import annotations

import numpy as np
import pytest

from estimator.so3 import cross, times


@pytest.mark.parametrize(
    ("one", "other"),
    [((3,), (3,)), ((50, 3), (50, 3)), ((4, 50, 3), (50, 3)), ((5, 1, 3), (7, 3)), ((0, 3), (0, 3))],
)
def test_cross_products_are_numpys_to_the_bit(one: tuple[int, ...], other: tuple[int, ...]) -> None:
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=one), rng.normal(size=other)
    np.testing.assert_array_equal(cross(a, b), np.cross(a, b))


def test_a_matrix_times_a_vector_has_the_same_bits_alone() -> None:
    rng = np.random.default_rng(1)
    M, v = rng.normal(size=(60, 3, 3)), rng.normal(size=(60, 3))
    whole = times(np.swapaxes(M, -1, -2), v)
    np.testing.assert_allclose(whole, (np.swapaxes(M, -1, -2) @ v[..., None])[..., 0], rtol=0.0, atol=1e-14)
    for k in range(60):
        np.testing.assert_array_equal(times(M[k].T, v[k]), whole[k])
    assert times(np.zeros((0, 3, 3)), np.zeros((0, 3))).shape == (0, 3)
    assert times(M[0], v).shape == (60, 3)
