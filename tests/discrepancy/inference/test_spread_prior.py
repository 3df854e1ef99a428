"""What is believed of a kind's spread before the data are seen."""

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from discrepancy import rules
from discrepancy.inference.prior import Level


def test_level_is_the_median_of_the_other_kinds():
    spread = np.array([10.0, 1.0, 8.0, 12.0, 9.0, 11.0, 7.0])
    level = Level.of(spread, np.ones(7))
    np.testing.assert_allclose(
        level.spread, [np.sort(np.delete(spread, k))[2] for k in range(7)]
    )  # lower middle
    np.testing.assert_allclose(level.numbers, rules.SPREAD_NUMBERS + 6.0)


@pytest.mark.parametrize("told", [1.0, 0.1])
def test_few_kinds_that_are_told_say_nothing_of_another(told):
    few = np.full(int(rules.LEVEL_KINDS), 10.0)
    assert (Level.of(few, np.full(len(few), told)).spread == 1.0).all()
    assert Level.of(np.zeros(0), np.zeros(0)).spread.shape == (0,)


def test_kinds_that_are_not_told_do_not_count():
    spread = np.array([10.0] * 7 + [1.0] * 9)
    told = np.array([1.0] * 7 + [0.01] * 9)
    assert Level.of(spread, told).spread[-1] == 10.0


def test_a_kind_is_held_against_what_suits_it():
    level = Level(np.full(2, 10.0), np.full(2, 20.0))
    loss, near, numbers = level.prior(np.array([1.0, 12.0]))
    np.testing.assert_allclose(near, [1.0, 10.0])
    np.testing.assert_allclose(numbers, [rules.SPREAD_NUMBERS, 20.0])
    # By so many numbers of which the mean square is that of the level: log density of their spread, at most 0.
    expected = 20.0 * (np.log(12.0 / 10.0) + 0.5 * (10.0 / 12.0) ** 2 - 0.5)
    np.testing.assert_allclose(loss, [0.0, expected], atol=1e-12)
    most = minimize_scalar(
        lambda s: level.prior(np.array([s, s]))[0][0], bounds=(5.0, 20.0), method="bounded"
    )
    assert most.x == pytest.approx(10.0, abs=1e-3)


def test_what_is_far_beyond_the_level_is_held_against_its_tolerance():
    """However many say so, a kind may be off for a reason of its own."""
    near = Level(np.array([10.0]), np.array([1000.0])).prior(np.array([100.0]))[1]
    assert near[0] == 1.0
