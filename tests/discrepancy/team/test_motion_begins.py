"""Where a motion begins, encoders repeat one rounding error: larger noise, and no misfit."""

from pathlib import Path

import numpy as np

from discrepancy.team.linear.start import linearised_trials, start_shared
from estimator.estimate.payload import estimate_payload
from estimator.recording.parquet import read_recording


def test_no_misfit_where_a_motion_begins(biased_trials: list[Path]) -> None:
    """Only a torque is wrong, so the grasps' rotations and positions are noise from the first row on."""
    recordings = [read_recording(path) for path in biased_trials[1:]]
    shared = start_shared(estimate_payload(recordings, "joint"))
    (trial,), sensed = linearised_trials(recordings, shared, {})
    poses, (white,) = 12, sensed.whitening
    power = np.mean(white(trial.residual)[:, :poses] ** 2, axis=1)
    assert power[:4].mean() < 1.6
    assert 0.8 < power[10 : white.moving].mean() < 1.2
    assert 2.0 < np.sqrt(np.mean(white.loudness[:2, :poses] ** 2)) < 5.0
    assert np.mean(white.loudness[20:, :poses] > 1.0) < 0.02
