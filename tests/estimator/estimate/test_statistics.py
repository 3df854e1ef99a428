import numpy as np
import pytest

from estimator.statistics import rms, rms_length


def test_root_mean_squares_of_entries_and_of_lengths() -> None:
    assert rms([3.0, -4.0]) == pytest.approx(np.sqrt(12.5))
    assert rms(np.array([[3.0, 4.0], [0.0, 0.0]])) == pytest.approx(2.5)
    assert rms_length(np.array([[3.0, -4.0], [0.0, 0.0]])) == pytest.approx(np.sqrt(12.5))
    assert rms_length(np.full((7, 3), 2.0)) == pytest.approx(2.0 * np.sqrt(3.0))
