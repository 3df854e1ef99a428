"""A line in the spectrum of what is left, against the power that a sine has in white noise."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from discrepancy import rules
from discrepancy.laws.lines import line_nats, peaks_hz
from discrepancy.least_squares.fit import Fit
from discrepancy.least_squares.problem import Problem
from linear_problem import CANDIDATES, random_rows

ROWS, RATE_HZ, CHANNELS, HUM_HZ = 400, 9.3, 3, 2.37
BENCH = SimpleNamespace(row_times=lambda trial: np.arange(ROWS) / RATE_HZ)


def left(seed, amplitude, trials=(0, 1, 2), count=3):
    """White noise in all trials, and a hum with it in some."""
    rows = random_rows(np.random.default_rng(seed), trials=count, n=ROWS)
    for t in trials:
        rows[t].residual[:] += amplitude * np.sin(2.0 * np.pi * HUM_HZ * BENCH.row_times(t) + t)[:, None]
    return Fit.of(Problem.of(rows, CANDIDATES))


def nats_of(amplitude):
    """Of noise that has p times its power at one frequency, in so many channels of a trial."""
    over = 1.0 + 0.25 * ROWS * amplitude**2
    return CHANNELS * (over - 1.0 - np.log(over))


@pytest.mark.parametrize("amplitude", [0.35, 0.5])
def test_a_hum_in_all_trials_is_worth_its_power(amplitude):
    """The trial that shows most does not count. (A louder one leaks into its surroundings.)"""
    found = [line_nats(left(seed, amplitude), BENCH) for seed in range(5)]
    assert np.mean(found) == pytest.approx(2.0 * nats_of(amplitude), rel=0.25)
    assert peaks_hz(left(0, amplitude), BENCH)[0] == pytest.approx(HUM_HZ, abs=rules.LAW_HUM_STEP_HZ)


def test_what_one_trial_shows_alone_is_its_motion():
    assert line_nats(left(1, 1.0, trials=(1,)), BENCH) < 15.0
    assert line_nats(left(1, 1.0, trials=(0,), count=1), BENCH) == 0.0


def test_white_noise_has_no_line():
    assert max(line_nats(left(seed, 0.0), BENCH) for seed in range(30)) < 20.0


@pytest.mark.parametrize("last_s", [50.0, 300.0])
def test_holds_after_the_motion_do_not_move_the_highest_frequency(last_s):
    """Their times had been taken for the rows': a hum was sought among aliases, or not up to what rows can show."""
    moving = 300
    times = np.concatenate([np.arange(moving) / RATE_HZ, np.linspace(40.0, last_s, ROWS - moving)])
    bench = SimpleNamespace(row_times=lambda trial: times)
    rows = random_rows(np.random.default_rng(4), n=ROWS)
    fast_hz = 0.93 * 0.5 * RATE_HZ
    for t, row in enumerate(rows):
        row.residual[:moving] += 0.6 * np.sin(2.0 * np.pi * fast_hz * times[:moving] + t)[:, None]
    fit = Fit.of(Problem.of([replace(row, moving=moving) for row in rows], CANDIDATES))
    peaks = peaks_hz(fit, bench)
    assert peaks[0] == pytest.approx(fast_hz, abs=rules.LAW_HUM_STEP_HZ)
    assert max(peaks) <= 0.5 * RATE_HZ
