"""Healthy logs of any logger leave noise alone, and what is left open where clocks were set by the motion."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from discrepancy.team.linear.noise import Fast
from discrepancy.team.linear.rows import Whitening
from discrepancy.team.linear.start import linearised_trials, start_shared
from discrepancy.team.linear.trial_linear import TrialLinear
from discrepancy.team.rig import TeamRig
from discrepancy.team.told import statements
from estimator.estimate.payload import estimate_payload
from estimator.recording.metadata import Sampling
from hidden import Logger
from team_case import exact, residual_of

LOGGERS = {
    "staggered": Logger(stagger_s=0.0037),
    "400 Hz": Logger(rate_hz=400.0),
    "50 Hz, drops": Logger(rate_hz=50.0, drops=0.01),
    "jitter, clocks": Logger(jitter_s=2e-4, offset_s=0.02, drift=2e-5),
    "14 bit": Logger(jitter_s=1e-3, encoder_bits=14, tau_noise_Nm=0.05, tau_step_Nm=0.0),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", LOGGERS)
def test_a_healthy_log_leaves_noise_alone(random_a, name):
    """Before errors were drawn at the readings these logs left 2 to 30 times the noise."""
    recording = LOGGERS[name].recorded(random_a, np.random.default_rng(7))
    estimate = estimate_payload([recording], "joint")
    (trial,), sensed = linearised_trials([recording], start_shared(estimate), {})
    noise, (white,) = sensed.noise, sensed.whitening
    np.testing.assert_allclose(noise.step[:2], 2 * np.pi / 2 ** LOGGERS[name].encoder_bits, rtol=1e-3)
    sigma = np.median(noise.sigma[2])
    assert sigma == pytest.approx(LOGGERS[name].tau_noise_Nm, rel=0.15)
    assert left_over(trial, white) == pytest.approx(1.0, abs=0.13)
    assert not Fast.of(trial.signals).lines.any()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["400 Hz", "jitter, clocks"])
def test_a_joint_that_chatters_in_a_log_is_no_noisy_sensor(random_a, name):
    tau = random_a.sensed.tau.copy()
    tau[:, 1, 0] += 4.0 * np.sin(2.0 * np.pi * 29.0 / random_a.sensed.rate_hz * np.arange(len(tau)))
    loud = replace(random_a, sensed=replace(random_a.sensed, tau=tau))
    recording = LOGGERS[name].recorded(loud, np.random.default_rng(7))
    (trial,), sensed = linearised_trials(
        [recording], start_shared(estimate_payload([recording], "joint")), {}
    )
    sigma, lines = sensed.noise.sigma[2], Fast.of(trial.signals).lines[2]
    np.testing.assert_allclose(sigma, LOGGERS[name].tau_noise_Nm, rtol=0.5)
    assert lines[1, 0] > 1.0
    lines[1, 0] = 0.0
    assert not lines.any()


def left_over(trial: TrialLinear, white: Whitening) -> float:
    """chi2 per degree of freedom beside all unknowns."""
    columns = np.concatenate([trial.by_shared, trial.by_bases, trial.by_clocks], axis=2)
    unknowns = white(columns).reshape(-1, columns.shape[2])
    left = white(trial.residual).ravel()
    left -= unknowns @ np.linalg.lstsq(unknowns, left, rcond=1e-12)[0]
    return float(left @ left / (left.size - unknowns.shape[1]))


def test_a_clock_set_by_the_motion_is_left_open():
    """Its columns against the residual of readings that were taken late, by a constant and by a drift."""
    case, late_s, drift = exact(), 1e-4, 1e-5
    aligned = [
        Sampling(100.0, 0.0, 0.0, 0.0, robot > 0, "untouched", "joint", (0.0,) * 9) for robot in range(3)
    ]
    linear = replace(case.linear, signals=replace(case.signals, sampling=tuple(aligned)))
    assert case.linear.by_clocks.shape[2] == 0
    assert linear.by_clocks.shape == (*linear.residual.shape, 4)
    time = case.signals.time
    for column, robot, shift in ((0, 1, np.full_like(time, late_s)), (3, 2, drift * (time - time.mean()))):
        late = {}
        for name in ("phi", "theta", "tau"):
            x = getattr(case.signals, name).copy()
            x[:, robot] = CubicSpline(time, x[:, robot])(time - shift)
            late[name] = x
        moved = residual_of(case, replace(case.signals, **late), case.shared, case.bases) - linear.residual
        expected = linear.by_clocks[..., column] * (late_s if column == 0 else drift)
        inner = slice(10, linear.reduction.moving - 10)  # late readings end before the signals do
        np.testing.assert_allclose(moved[inner], expected[inner], atol=0.02 * np.abs(expected).max())


@pytest.mark.slow
def test_clocks_that_the_motion_set_are_no_candidates(random_a):
    """What was taken out of the stamps cannot be found in them, and a candidate would fit anything else by it."""
    recording = LOGGERS["jitter, clocks"].recorded(random_a, np.random.default_rng(7))
    assert [s.aligned for s in recording.metadata.sampling] == [False, True, True]
    rig = TeamRig.of([recording], estimate_payload([recording], "joint"), {})
    assert "clock_delay" not in {candidate.cause for candidate in rig.candidates()}
    assert "the robots' clocks" in {entry["what"] for entry in statements(rig.robots, aligned=rig.aligned)}
    believed = replace(recording, metadata=replace(recording.metadata, sampling=None))
    rig = TeamRig.of([believed], estimate_payload([believed], "joint"), {})
    assert "clock_delay" in {candidate.cause for candidate in rig.candidates()}
