"""What the sensors add to the truth, against the presets' definitions."""

import dataclasses

import numpy as np
import pytest
from scipy.stats import chi2

from estimator.errors import InputError
from mocobot_sim.control.control import ControlGains
from mocobot_sim.scene.as_built import AsBuilt
from mocobot_sim.scene.models import omnid_design
from mocobot_sim.scene.scene import build_team
from mocobot_sim.trial.sensors import PRESETS, SensorPreset, measure, sensor_preset
from mocobot_sim.trial.trajectories import random_vias
from mocobot_sim.trial.trial import run_trial

CHANNELS = ("phi", "theta", "tau")


def _rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def _units(**changes) -> list[AsBuilt]:
    """Only the second robot is off."""
    return [AsBuilt(), AsBuilt(**{name: np.array(value) for name, value in changes.items()}), AsBuilt()]


def test_presets_are_the_documented_ones():
    assert list(PRESETS) == ["ideal", "nominal", "uncalibrated"]
    ideal, nominal, uncalibrated = (sensor_preset(name) for name in PRESETS)
    assert (ideal.encoder_bits, ideal.tau_step_Nm, ideal.tau_noise_Nm) == (None, 0.0, 0.0)
    for preset in (nominal, uncalibrated):
        assert (preset.encoder_bits, preset.tau_step_Nm, preset.tau_noise_Nm) == (16, 0.01, 0.01)
    assert ideal.calibrated
    assert nominal.calibrated
    assert not uncalibrated.calibrated
    spread = uncalibrated.spread
    np.testing.assert_allclose(
        [spread.encoder_zero_rad, spread.stiffness_ratio, spread.geometry_m, spread.tau_zero_Nm],
        [np.pi / 180, 0.02, 0.001, 0.02],
        rtol=1e-15,
    )
    assert all(preset.name == name for name, preset in PRESETS.items())


def test_unknown_preset_is_named():
    with pytest.raises(
        InputError, match="preset 'best' does not exist; the presets are ideal, nominal, uncal"
    ):
        sensor_preset("best")


def test_ideal_sensors_pass_the_truth_bit_for_bit(random_a):
    recording = measure(random_a, sensor_preset("ideal"), _rng())
    np.testing.assert_array_equal(recording.time, random_a.time)
    for channel in CHANNELS:
        np.testing.assert_array_equal(getattr(recording, channel), getattr(random_a, channel))
        assert getattr(recording, channel).flags.c_contiguous, "like one that is read from a file"
    np.testing.assert_array_equal(recording.ref, random_a.ref_b)


def test_readings_lie_on_the_grid(random_a):
    recording = measure(random_a, sensor_preset("nominal"), _rng())
    for channel, step in (("phi", 2 * np.pi / 65536), ("theta", 2 * np.pi / 65536), ("tau", 0.01)):
        counts = (getattr(recording, channel) - getattr(recording, channel)[0]) / step
        np.testing.assert_allclose(counts, np.round(counts), rtol=0, atol=1e-6)
        assert len(np.unique(np.round(counts))) > 100
    step = 2 * np.pi / 65536
    for channel in ("phi", "theta"):
        error = getattr(recording, channel) - getattr(random_a, channel)
        assert np.abs(error).max() <= 0.5001 * step
        assert np.abs(error).max() > 0.49 * step
        assert abs(error.mean()) < 0.1 * step


def _check_sigma(values: np.ndarray, sigma: float) -> None:
    n = values.size
    low, high = chi2.ppf([1e-6, 1 - 1e-6], n)
    assert low < np.sum(values**2) / sigma**2 < high
    assert abs(values.mean()) < 5 * sigma / np.sqrt(n)


def test_torque_noise_has_the_stated_deviation_and_is_white(random_a):
    recording = measure(random_a, SensorPreset("test", tau_noise_Nm=0.03), _rng(1))
    noise = recording.tau - random_a.tau
    assert noise.size > 10_000
    _check_sigma(noise, 0.03)
    flat = noise.reshape(len(noise), 9)
    bound = 5 / np.sqrt(len(flat))
    assert np.abs(np.corrcoef(flat.T) - np.eye(9)).max() < bound
    assert np.abs(np.mean(flat[1:] * flat[:-1], axis=0)).max() / 0.03**2 < bound
    np.testing.assert_array_equal(recording.phi, random_a.phi)


def test_zeros_shift_the_readings_of_their_own_channel(random_a):
    phi, theta, tau = [0.01, -0.02, 0.03], [0.04, 0.05, -0.06], [0.1, 0.2, -0.3]
    units = _units(phi_zero_rad=phi, theta_zero_rad=theta, tau_zero_Nm=tau)
    recording = measure(dataclasses.replace(random_a, units=units), sensor_preset("ideal"), _rng())
    for channel, zero in zip(CHANNELS, (phi, theta, tau), strict=True):
        shift = getattr(recording, channel) - getattr(random_a, channel)
        np.testing.assert_allclose(shift[:, 1], np.tile(zero, (len(shift), 1)), rtol=0, atol=1e-13)
        assert not shift[:, [0, 2]].any()


def test_a_stiff_spring_reads_low():
    """Design stiffness (100 N m/rad) times the deflection that the true torque causes in the true spring."""
    ratio = np.array([0.05, -0.02, 0.0])
    scene = build_team("a", _units(stiffness_ratio=ratio))
    log = run_trial(scene, random_vias(scene.wrist_home_b, _rng(), 1))
    recording = measure(log, sensor_preset("ideal"), _rng())
    deflection = log.tau[:, 1] / (100.0 * (1 + ratio))
    np.testing.assert_allclose(recording.tau[:, 1], 100.0 * deflection, rtol=1e-14)
    assert np.all(np.abs(recording.tau[:, 1, 0]) < np.abs(log.tau[:, 1, 0]))
    np.testing.assert_array_equal(recording.tau[:, 0], log.tau[:, 0])


@pytest.mark.parametrize("preset", list(PRESETS))
def test_same_seed_same_bits(random_a, preset):
    one, two = (measure(random_a, sensor_preset(preset), _rng(6)) for _ in range(2))
    for channel in CHANNELS:
        np.testing.assert_array_equal(getattr(one, channel), getattr(two, channel))
    other = measure(random_a, sensor_preset(preset), _rng(7))
    assert np.any(other.tau != one.tau) == (preset != "ideal")


def test_metadata_says_what_was_simulated(random_a):
    recording = measure(random_a, sensor_preset("nominal"), _rng(), payload="a", seed=12)
    meta = recording.metadata
    assert (meta.robots, meta.rate_hz, meta.trial, meta.payload, meta.seed) == (3, 100.0, "random", "a", 12)
    assert "nominal" in meta.source
    assert meta.design == omnid_design(), "the design, not the unit as built"
    assert ControlGains.from_dict(meta.control) == random_a.gains
    np.testing.assert_array_equal(meta.control["feed_forward_N"], random_a.feed_forward)
