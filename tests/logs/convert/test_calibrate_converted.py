"""Logs that went through ``convert`` are calibrated as recordings that were read on the grid."""

from pathlib import Path

import numpy as np
import pytest

from estimator.calibrate.calibrate import calibrate
from estimator.calibrate.prior import Prior
from estimator.recording.parquet import read_recording
from mocobot.cli import main
from synthetic_team import carry, draw_path, draw_units, load

STEP_RAD, STEP_NM, NOISE_NM = 2 * np.pi / 2**16, 0.01, 0.01


@pytest.mark.parametrize(("rate_hz", "jitter_s"), [(250.0, 5e-4), (60.0, 0.0)])
def test_noise_of_a_converted_log_is_known(tmp_path: Path, rate_hz: float, jitter_s: float) -> None:
    """Readings averaged into a sample, and one reading that several samples are made of."""
    rng = np.random.default_rng(41)
    units, held = draw_units(3, Prior(), rng), load(3, rng)
    recordings = []
    for k in range(2):
        exact = carry(units, held, draw_path(held, rng), rng, 25.0, rate_hz * 4).recording
        at = 4 * np.arange(1, len(exact.time) // 4 - 1)
        at = at + np.clip(np.round(jitter_s * rate_hz * 4 * rng.standard_normal(len(at))), -1, 1).astype(int)
        columns, names = [exact.time[at]], ["time"]
        for robot in range(3):
            for readings, suffixes, step, noise in (
                (exact.phi, ("phi1", "phi2", "phi3"), STEP_RAD, 0.0),
                (exact.theta, ("theta_z", "theta_y", "theta_x"), STEP_RAD, 0.0),
                (exact.tau, ("tau1", "tau2", "tau3"), STEP_NM, NOISE_NM),
            ):
                grid = step * rng.uniform(-0.5, 0.5, 3)
                read = readings[at, robot] + noise * rng.standard_normal((len(at), 3)) + grid
                columns += list((np.round(read / step) * step - grid).T)
                names += [f"omnid{robot + 1}.{suffix}" for suffix in suffixes]
        log, out = tmp_path / f"log{k}.csv", tmp_path / f"trial{k}.parquet"
        np.savetxt(
            log, np.column_stack(columns), delimiter=",", header=",".join(names), comments="", fmt="%.9f"
        )
        main(["convert", str(log), str(out), "--trial", "random"])
        recordings.append(read_recording(out))
    calibration = calibrate(recordings)
    assert calibration.findings == ()
    for trial in calibration.trials:
        assert trial.after == pytest.approx((1.0, 1.0), abs=0.25)
    off = calibration.payloads[0].grasps.p_1i - held.p_1i
    assert np.abs(off).max() < 3e-3
