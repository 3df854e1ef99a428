"""Rows of a trial: what they keep, what noise leaves in them, and that they are independent."""

import numpy as np
import pytest

from calibration_case import exact_trial
from estimator.calibrate import rules
from estimator.calibrate.calibration import Prior
from estimator.calibrate.equations import TrialEquations
from estimator.calibrate.rows import Rows, Sensing
from estimator.recording.model import Recording
from recordings import metadata
from synthetic_team import carry, draw_path, draw_units, load, with_noise


def recording_of(phi, rate_hz=100.0) -> Recording:
    """Two robots whose every channel is the same signal, shape (Q,)."""
    x = np.repeat(np.asarray(phi)[:, None, None], 2, axis=1)
    x = np.repeat(x, 3, axis=2)
    return Recording(np.arange(len(x)) / rate_hz, x, x.copy(), x.copy(), None, metadata(2, rate_hz=rate_hz))


@pytest.mark.parametrize("rate_hz", [50.0, 100.0, 240.0])
def test_a_slow_signal_passes_with_its_derivatives(rate_hz):
    """To a percent, residual and derivatives alike."""
    time = np.arange(round(20 * rate_hz)) / rate_hz
    w = 2 * np.pi * 0.3
    recording = recording_of(0.2 * np.sin(w * time) + 0.4, rate_hz)
    recording.theta[:, 1] = 0.2 * np.cos(w * time)[:, None]  # something always moves
    rows = Rows.of(recording)
    out = rows(rows.s)[:, 0]
    assert len(rows.time) > 50
    assert out[:, 0] == pytest.approx(0.2 * np.sin(w * rows.time) + 0.4, abs=0.002)
    assert out[:, 3] == pytest.approx(0.2 * w * np.cos(w * rows.time), abs=0.002 * w)
    assert out[:, 6] == pytest.approx(-0.2 * w**2 * np.sin(w * rows.time), abs=0.002 * w**2)


def test_noise_in_rows_is_as_the_gain_says_and_independent():
    rng = np.random.default_rng(1)
    time = np.arange(90_000) / 100.0
    quiet = recording_of(0.3 * np.sin(2 * np.pi * 0.2 * time))
    noisy = with_noise(quiet, 1.0, 1.0, rng)
    rows = Rows.of(quiet)
    noise = rows(Rows.of(noisy).s[: len(rows.s)] - rows.s)
    angle, speed, acceleration = (
        noise[..., first : first + 3].reshape(len(noise), -1) for first in (0, 3, 6)
    )
    chains = np.stack([angle, speed, acceleration])
    found = np.einsum("aqc,bqc->ab", chains, chains) / angle.size
    scale = np.sqrt(np.diag(rows.gain))
    n = angle.size
    assert found / np.outer(scale, scale) == pytest.approx(
        rows.gain / np.outer(scale, scale), abs=4 * np.sqrt(2 / n)
    )
    # What varies slowly is averaged over many rows: sums of their correlations count, not one alone.
    correlation = [np.sum(angle[k:] * angle[:-k]) / np.sum(angle**2) for k in range(1, 7)]
    assert np.abs(correlation).max() < 0.03
    assert 1.0 + 2.0 * np.sum(correlation) == pytest.approx(1.0, abs=0.06)


def test_holds_are_one_row_each():
    """Three holds of 4 s: a mean over all of each but its ends."""
    level, time = [], np.arange(0, 21, 0.01)
    for t in time:
        s = np.clip((t % 7.0 - 5.0) / 2.0, 0.0, 1.0)
        level.append(t // 7.0 + s**3 * (10 - 15 * s + 6 * s**2))
    rows = Rows.of(recording_of(0.1 * np.array(level)))
    held = rows(rows.s)[rows.moving :, 0, 0]
    # The first begins before the trimmed two seconds are over, and no hold is complete at the end.
    assert held == pytest.approx([0.0, 0.1, 0.2], abs=1e-6)
    settled = 5.0 - 2 * rules.SETTLING_S
    assert rows.length[rows.moving + 1] / 100.0 == pytest.approx(settled, abs=0.6)
    assert (rows.length[: rows.moving] == 0).all()
    assert rows.moving > 5


def test_a_hold_of_encoders_without_noise_has_one_rounding_error():
    sensing = Sensing(np.full((2, 9), 1e-4), np.zeros((2, 9)))
    time = np.arange(0, 20, 0.01)
    rows = Rows.of(recording_of(np.where(time < 10, 0.1, 0.1 + 0.02 * (time - 10))))
    moving, held = sensing.variances(rows)
    floor = rules.PHI_FLOOR_RAD**2
    resting = rules.AT_REST**2 * floor
    hold = rows.moving  # the first hold
    assert held[hold, 0, 0] == pytest.approx(1e-8 / 12 + resting, rel=1e-9)
    # In motion a joint at 0.02 rad/s makes 200 steps a second: every sample's error is its own.
    assert moving[rows.moving // 2, 0, 0] == pytest.approx(1e-8 / 12 + floor, rel=1e-9)
    dithered = Sensing(np.full((2, 9), 1e-4), np.full((2, 9), 1e-4)).variances(rows)[1]
    length = rows.length[hold]
    assert dithered[hold, 0, 0] == pytest.approx((1e-8 + 1e-8 / 12) / length + resting, rel=1e-9)


def test_sensing_finds_steps_and_noise():
    exact = exact_trial(3)[2]
    rng = np.random.default_rng(4)
    noisy = with_noise(exact.recording, 2e-5, 0.004, rng)
    found = Sensing.of([noisy])
    assert not found.step.any()
    assert found.sigma == pytest.approx(np.tile(np.repeat([2e-5, 2e-5, 0.004], 3), (3, 1)), rel=0.15)


def test_ripple_of_slow_rounding_is_no_noise():
    """A joint of 50 steps a second: its rounding errors are as fast as noise, but no reading goes back."""
    time, step = np.arange(0, 40, 0.01), 1e-4
    slow = 1.3e-3 * np.sin(2 * np.pi * 0.67 * time)

    def found(noise):
        read = slow + noise * step * np.random.default_rng(5).standard_normal(len(time))
        return Sensing.of([recording_of(np.round(read / step) * step)])

    assert found(0.0).step[0, 0] == pytest.approx(step)
    assert found(0.0).sigma[0, 0] < 0.05 * step  # 0.44 of one by its frequencies alone
    assert found(0.5).sigma[0, 0] == pytest.approx(0.5 * step, rel=0.2)


def test_each_joint_has_its_own_rounding_errors_again():
    """Of a cycle that is no whole number of samples, a slow joint's readings come again, and a fast one's do not."""
    time, step = np.arange(0, 44, 0.01), 1e-4
    angle = 2 * np.pi * 0.6037 * time
    trial = recording_of(np.round(0.1 * np.sin(angle) / step) * step)
    trial.theta[:] = (np.round(1.2e-3 * np.sin(angle) / step) * step)[:, None, None]
    trial.phi[:, 1] = 0.1 * np.cos(angle)[:, None]  # something always moves
    repeats = Rows.of(trial).repeats
    assert repeats.shape == (2, 9)
    assert np.all(repeats[:, 3:6] > 0.7 * 40 * 0.6037)
    assert np.all(repeats[0, [0, 1, 2, 6, 7, 8]] < 4.0)


@pytest.mark.slow
def test_residual_of_the_truth_has_the_covariance_of_its_rows():
    """Monte Carlo of whole trials: chi2 per number, and NEES of what is constant over a trial."""
    rng = np.random.default_rng(5)
    units, held = draw_units(3, Prior(), rng), load(3, rng)
    exact = carry(units, held, draw_path(held, rng), rng, 12.0)
    chi2, sums = [], []
    for _ in range(60):
        noisy = with_noise(exact.recording, 5e-5, 0.02, rng)
        equations = TrialEquations.of(Rows.of(noisy), Sensing(np.zeros((3, 9)), SIGMA))
        if not chi2:
            claimed = equations.at(units, held.shared, exact.bases).covariance
        residual = equations.residual(units, held.shared, exact.bases)
        chi2.append(np.einsum("qc,qcd,qd->q", residual, np.linalg.inv(claimed), residual).mean() / 18)
        total = residual.sum(axis=0)
        sums.append(total @ np.linalg.solve(claimed.sum(axis=0), total) / 18)
    assert np.mean(chi2) == pytest.approx(1.0, abs=0.05)
    # Accelerations' noise does not sum up: the balance is known better than claimed, never worse.
    assert 0.6 < np.mean(sums) < 1.1


SIGMA = np.tile(np.repeat([5e-5, 5e-5, 0.02], 3), (3, 1))
