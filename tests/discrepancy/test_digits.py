"""Numbers in sentences."""

import math

import pytest

from discrepancy.numbers import three_digits


@pytest.mark.parametrize(
    ("value", "said"),
    [
        (0.98, "0.98"),
        (1.0, "1"),
        (19.149, "19.1"),
        (999.6, "1000"),
        (12167.3, "12200"),
        (2.5e9, "2500000000"),
    ],
)
def test_as_many_as_are_needed_and_no_power_of_ten(value, said):
    assert three_digits(value) == said


def test_what_is_tiny_or_huge_has_a_power_of_ten_and_infinity_is_said():
    assert three_digits(1.234e-7) == "1.23e-07"
    assert three_digits(1.234e15) == "1.23e+15"
    assert three_digits(math.inf) == "inf"
