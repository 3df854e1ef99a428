"""From samples to rows: one linear map, a low-pass and decimation in motion, one mean per hold."""

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from discrepancy.team.linear.rows import TEAM_ROWS_HZ, Reduction
from discrepancy.team.linear.signals import TEAM_TRIM_S, Signals

QUANTUM = 2 * np.pi / 2**16


def signals(duration_s=20.0, rate_hz=100.0, holds=((5.0, 10.0),), rounded=False):
    """Every joint of two robots sways at 0.3 rad/s; during a hold all stand still, angles continuous."""
    time = np.arange(round(duration_s * rate_hz)) / rate_hz
    moving = np.ones(len(time))
    for start, stop in holds:
        moving[(time >= start) & (time < stop)] = 0.0
    phase = np.cumsum(moving) / rate_hz
    pattern = 0.5 + 0.3 * np.sin(phase[:, None, None] + np.arange(6).reshape(2, 3))
    if rounded:
        pattern = np.round(pattern / QUANTUM) * QUANTUM
    return Signals(time, pattern, 0.5 * pattern, 3.0 * pattern, rate_hz)


@pytest.fixture(scope="module")
def trial():
    return signals()


@pytest.fixture(scope="module")
def reduction(trial):
    return Reduction.of(trial)


def test_map_is_linear_and_the_same_for_every_column(trial, reduction):
    rng = np.random.default_rng(1)
    x, y = rng.standard_normal((2, len(trial.time), 2, 3))
    np.testing.assert_allclose(
        reduction(2.0 * x - 3.0 * y), 2.0 * reduction(x) - 3.0 * reduction(y), atol=1e-12
    )
    assert reduction(x).shape == (len(reduction.time), 2, 3)
    np.testing.assert_allclose(reduction(x)[:, 1, 2], reduction(x[:, 1, 2]), atol=1e-15)
    np.testing.assert_allclose(reduction.operator.toarray() @ x[:, 0, 0], reduction(x[:, 0, 0]), atol=1e-12)


def test_hold_is_one_row_its_mean(trial, reduction):
    assert len(reduction.time) - reduction.moving == 1
    x = np.random.default_rng(2).standard_normal(len(trial.time))
    used = np.flatnonzero(reduction.operator.toarray()[-1])
    assert reduction(x)[-1] == pytest.approx(x[used].mean())
    # Still is what the 2 Hz filter leaves slower than 1 mrad/s; 0.3 s of settling go at either end.
    smooth = sosfiltfilt(butter(3, 2.0, fs=100.0, output="sos"), trial.phi.reshape(-1, 6), axis=0)
    slow = np.abs(np.gradient(smooth, 0.01, axis=0)).max(axis=1) < 1e-3
    still = trial.time[[np.flatnonzero(~slow[:750]).max() + 1, 750 + np.flatnonzero(~slow[750:]).min() - 1]]
    assert np.all(np.diff(used) == 1)
    assert trial.time[used[0]] == pytest.approx(still[0] + 0.3, abs=0.04)
    assert trial.time[used[-1]] == pytest.approx(still[-1] - 0.3, abs=0.04)
    assert reduction.time[-1] == pytest.approx(7.5, abs=0.1)
    centre = trial.time[reduction.sample[: reduction.moving]]
    assert not np.any((centre >= trial.time[used[0]]) & (centre <= trial.time[used[-1]]))


@pytest.mark.parametrize(("rate", "step"), [(100.0, 8), (250.0, 20), (50.0, 4), (1000.0, 80)])
def test_moving_rows_come_at_one_rate(rate, step):
    trial = signals(10.0, rate, ())
    reduction = Reduction.of(trial)
    assert reduction.step == step == round(rate / TEAM_ROWS_HZ)
    assert reduction.moving == len(reduction.time)
    np.testing.assert_allclose(np.diff(reduction.time), step / rate)
    np.testing.assert_array_equal(reduction.time, trial.time[reduction.sample])
    assert reduction.time[0] >= TEAM_TRIM_S
    assert reduction.time[-1] < 10.0 - TEAM_TRIM_S
    assert reduction.moving == pytest.approx((10.0 - 2 * TEAM_TRIM_S) * rate / step, abs=1)


@pytest.mark.parametrize("frequency", [0.5, 2.0, 5.0, 8.0, 12.0])
def test_gain_is_that_of_the_filter(frequency):
    """1 / (1 + (f / 5 Hz)^6): two passes of a third-order Butterworth filter; zero phase."""
    trial = signals(40.0, 250.0, ())
    reduction = Reduction.of(trial)
    for phase in (0.0, np.pi / 2):
        row = reduction(np.cos(2 * np.pi * frequency * trial.time + phase))
        expected = np.cos(2 * np.pi * frequency * reduction.time + phase) / (1.0 + (frequency / 5.0) ** 6)
        np.testing.assert_allclose(row, expected, atol=0.01)


@pytest.mark.parametrize(
    "span", [(0, 0), (1, 2), (190, 1400), (700, 761), (1000, 1001), (1640, 1700), (1, 1999)]
)
def test_what_is_there_for_a_while_is_reduced_as_a_dense_matrix_does_it(span):
    """Holds before, in and after it, too; nothing at all is no rows but noughts."""
    reduction = Reduction.of(signals(20.0, holds=((3.0, 8.0), (10.0, 15.0))))
    x = np.zeros((2000, 3, 2))
    x[slice(*span)] = np.random.default_rng(6).standard_normal((span[1] - span[0], 3, 2))
    expected = np.einsum("nq,qci->nci", reduction.operator.toarray(), x)
    np.testing.assert_allclose(reduction(x), expected, atol=1e-12)
    assert len(reduction.time) > reduction.moving
