import pytest

from estimator.statistics import decimals, measured


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
