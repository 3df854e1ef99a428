"""The longest gap that is filled by default: what it lets through, and what it costs, on a simulated motion."""

from __future__ import annotations

import numpy as np

import mocobot
from array_log import ArrayLog, stream
from mocobot.options import Convert
from mocobot_logs.resample.log import MAX_GAP_S, resample


def test_four_in_a_row_lost_at_50_hz_are_filled_within_the_sensors_noise():
    """Coarse encoders (12 bits) err by 0.44 mrad, good ones (17 bits) by 14 urad; torques by 3 mN m and more."""
    trial = mocobot.simulate(payload="c", vias=12, preset="ideal", seed=5)
    time, robot = trial.time[::2], 1
    values = np.concatenate([trial.phi[::2, robot], trial.theta[::2, robot], trial.tau[::2, robot]], axis=1)
    first = np.arange(60, len(time) - 60, 90)
    gone = (first[:, None] + np.arange(4)).ravel()
    log = ArrayLog([stream(np.delete(time, gone), np.delete(values, gone, axis=0))])
    found = resample(log, rate_hz=50.0)
    assert found.reports[0].filled == len(gone) > 8
    error = (found.values[0] - values)[gone]
    assert np.sqrt(np.mean(error[:, :6] ** 2)) < 14e-6
    assert np.sqrt(np.mean(error[:, 6:] ** 2)) < 10e-3
    assert np.abs(error).max() > 0.0


def test_the_command_has_the_same_limit():
    assert Convert.__dataclass_fields__["max_gap_s"].default == MAX_GAP_S
