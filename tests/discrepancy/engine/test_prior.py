"""What is believed of a kind's spread before the data are seen."""

import numpy as np
import pytest

from discrepancy import rules
from discrepancy.inference.prior import far, levels, nearest


def test_level_is_the_median_of_the_other_kinds():
    spread = np.array([10.0, 1.0, 8.0, 12.0, 9.0, 11.0, 7.0])
    expected = [np.sort(np.delete(spread, k))[2] for k in range(7)]  # of six the lower middle one
    np.testing.assert_allclose(levels(spread, np.ones(7)), expected)


@pytest.mark.parametrize("told", [1.0, 0.1])
def test_few_kinds_that_are_told_say_nothing_of_another(told):
    few = np.full(int(rules.LEVEL_KINDS), 10.0)
    assert (levels(few, np.full(len(few), told)) == 1.0).all()
    assert levels(np.zeros(0), np.zeros(0)).shape == (0,)


def test_kinds_that_are_not_told_do_not_count():
    spread = np.array([10.0] * 7 + [1.0] * 9)
    told = np.array([1.0] * 7 + [0.01] * 9)
    assert levels(spread, told)[-1] == 10.0


def test_a_kind_is_held_against_what_suits_it():
    np.testing.assert_allclose(nearest(np.array([1.0, 12.0]), 10.0), [1.0, 10.0])
    np.testing.assert_allclose(far(np.array([1.0, 10.0]), np.array([1.0, 10.0])), 0.0, atol=1e-15)
    assert far(np.array([10.0]), 1.0)[0] == pytest.approx(2.0 * np.log(10.0) + 0.01 - 1.0)
