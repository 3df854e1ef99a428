"""Columns of what is open for a while: partitions of one, straight between knots."""

import numpy as np

from discrepancy.team.causes.friction import free_while

RATE_HZ = 100.0


def where(*intervals, samples=400):
    mask = np.zeros(samples, dtype=bool)
    for start, stop in intervals:
        mask[start:stop] = True
    return mask


def test_any_straight_line_inside_is_a_combination():
    mask = where((50, 101), (300, 330))
    columns = np.array(free_while(mask, RATE_HZ, 0.2)).T
    assert columns.shape == (400, 4 + 3)  # 0.51 s: three pieces, 0.3 s: two
    np.testing.assert_allclose(columns.sum(axis=1), mask.astype(float))
    line = np.where(mask, 3.0 - 0.02 * np.arange(400), 0.0)
    values = np.linalg.lstsq(columns, line, rcond=None)[0]
    np.testing.assert_allclose(columns @ values, line, atol=1e-12)
    bent = np.where(mask, np.abs(np.arange(400) - 67.0), 0.0)  # not at a knot
    rest = columns @ np.linalg.lstsq(columns, bent, rcond=None)[0] - bent
    assert np.abs(rest).max() > 0.3


def test_short_intervals_are_left_out_on_request():
    mask = where((10, 20), (50, 90))
    assert len(free_while(mask, RATE_HZ, 0.5, 0.15)) == 2
    assert len(free_while(mask, RATE_HZ, 0.5)) == 4


def test_intervals_at_the_ends_and_none_at_all():
    assert free_while(where(), RATE_HZ, 0.2) == []
    everywhere = np.array(free_while(where((0, 400)), RATE_HZ, 1.0))
    np.testing.assert_allclose(everywhere.sum(axis=0), 1.0)
    one = free_while(where((7, 8)), RATE_HZ, 0.2)  # a single sample
    np.testing.assert_array_equal(np.flatnonzero(np.sum(one, axis=0)), [7])
