"""Products of vectors to the bit, root mean squares, and numbers as they are printed."""

from __future__ import annotations

import numpy as np
import pytest

from estimator.so3 import cross, times
from estimator.statistics import decimals, measured, rms, rms_length


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


def test_root_mean_squares_of_entries_and_of_lengths() -> None:
    assert rms([3.0, -4.0]) == pytest.approx(np.sqrt(12.5))
    assert rms(np.array([[3.0, 4.0], [0.0, 0.0]])) == pytest.approx(2.5)
    assert rms_length(np.array([[3.0, -4.0], [0.0, 0.0]])) == pytest.approx(np.sqrt(12.5))
    assert rms_length(np.full((7, 3), 2.0)) == pytest.approx(2.0 * np.sqrt(3.0))


@pytest.mark.parametrize(
    ("value", "se", "shown"),
    [
        (11.671964, 0.00019, ("11.67196", "0.00019")),
        (-0.05, 0.0012, ("-0.0500", "0.0012")),
        (1234.5678, 31.0, ("1235", "31")),
        (123456.0, 5200.0, ("123456", "5200")),
        (1.0, 9.99e-3, ("1.0000", "0.0100")),
        (1.0, 2e-15, ("1.000000000", "0.000000000")),
    ],
)
def test_both_end_at_the_second_digit_of_the_error(value: float, se: float, shown: tuple[str, str]) -> None:
    assert measured(value, se) == shown


def test_decimals_go_on_above_one() -> None:
    assert [decimals(se) for se in (0.1, 1.0, 10.0, 99.0, 100.0, 5200.0)] == [2, 1, 0, 0, -1, -2]
