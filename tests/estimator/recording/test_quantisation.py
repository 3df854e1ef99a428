import numpy as np
import pytest

from estimator.quantisation import quantisation_step


def test_few_levels_tell_a_step_where_asked() -> None:
    """A payload at rest: the encoder flickers between neighbouring values."""
    resting = 0.3 + 1e-3 * np.array([0, 1, 1, 0, 2, 1, 0, 0, 2])
    assert quantisation_step(resting) is None
    assert quantisation_step(resting, levels=2) == pytest.approx(1e-3, rel=1e-9)
    assert quantisation_step(resting[:4], levels=2) == pytest.approx(1e-3, rel=1e-9)


def test_a_constant_has_no_step_however_few_levels_are_asked_for() -> None:
    assert quantisation_step(np.full(50, 0.1), levels=1) is None
    # One value that came out as two that differ in rounding.
    assert quantisation_step(np.array([0.1, np.nextafter(0.1, 1.0), 0.1]), levels=2) is None
    assert quantisation_step(np.empty(0), levels=2) is None


@pytest.mark.parametrize("digits", [1e-15, 1e-13, 1e-12, 1e-11])
def test_values_that_differ_in_rounding_are_one(digits: float) -> None:
    rng = np.random.default_rng(0)
    values = 2e-7 * rng.integers(0, 400000, 5000)
    disturbed = values * (1.0 + digits * rng.standard_normal(len(values)))
    assert quantisation_step(disturbed) == pytest.approx(2e-7, rel=1e-5)


def test_gaps_far_wider_than_a_step_do_not_hide_it() -> None:
    """A channel that visits two distant places only."""
    here = 1e-4 * np.arange(12)
    assert quantisation_step(np.concatenate([here, 5.00007 + here])) == pytest.approx(1e-4, rel=1e-9)
