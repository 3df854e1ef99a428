"""Cross products against numpy's."""

from __future__ import annotations

import numpy as np
import pytest

from estimator.so3 import cross


@pytest.mark.parametrize(
    ("one", "other"),
    [((3,), (3,)), ((50, 3), (50, 3)), ((4, 50, 3), (50, 3)), ((5, 1, 3), (7, 3)), ((0, 3), (0, 3))],
)
def test_cross_products_are_numpys_to_the_bit(one: tuple[int, ...], other: tuple[int, ...]) -> None:
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=one), rng.normal(size=other)
    np.testing.assert_array_equal(cross(a, b), np.cross(a, b))
