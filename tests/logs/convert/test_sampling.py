"""What a converted recording says of how its sensors were read, and what that makes of their errors."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, freqz_sos, sosfiltfilt

from array_log import ArrayLog, stream
from estimator.errors import InputError
from estimator.leftover.steps import steps_of
from estimator.recording.metadata import RecordingMetadata
from estimator.recording.sampling import Sampling
from mocobot_inspect.survey import survey
from mocobot_logs.one_clock import to_recording
from mocobot_logs.resample.log import resample
from mocobot_logs.resample.resampling import Resampling
from omnid_design import DESIGN

STEP = 2 * np.pi / 2**14
KNOWN = Sampling(400.0, -0.01, 2e-4, 0.02, False, "interpolated", "joint", (STEP,) * 6 + (0.0,) * 3)


@pytest.fixture
def rng():
    return np.random.default_rng(11)


def sway(time_s, robot: int) -> np.ndarray:
    """Angles that turn all joints, rounded; torques that are not."""
    phase = np.arange(9) + robot
    x = 0.3 * np.sin(2 * np.pi * 0.4 * time_s[:, None] + phase) + 0.1 * np.sin(
        2 * np.pi * 0.13 * time_s[:, None]
    )
    x[:, :6] = np.round(x[:, :6] / STEP) * STEP
    return x


def converted(times, **options):
    log = ArrayLog([stream(1.0 + t, sway(t, i)) for i, t in enumerate(times)])
    return to_recording(resample(log), design=DESIGN, trial="random", **options)[0]


def test_samples_on_one_grid_need_no_words():
    time = np.arange(3000) / 100.0
    assert converted([time, time]).metadata.sampling is None


def test_what_is_told(rng):
    even = 0.0037 + np.arange(12000) / 400.0
    jittered = np.sort(np.arange(3000) / 100.0 + 3e-4 * rng.standard_normal(3000)) + 0.001
    jittered = np.delete(jittered, rng.choice(np.arange(5, 2900), 60, replace=False))
    recording = converted([even, jittered, np.arange(3000) / 100.0])
    filtered, interpolated, shifted = recording.metadata.sampling
    assert [s.method for s in (filtered, interpolated, shifted)] == ["filtered", "interpolated", "untouched"]
    assert not any(s.aligned for s in recording.metadata.sampling)
    assert filtered.native_hz == pytest.approx(400.0, rel=1e-6)
    assert interpolated.missing == pytest.approx(0.02, abs=1e-3)
    assert interpolated.jitter_s == pytest.approx(3e-4, rel=0.1)
    # Robot 1's grid starts where its low-pass is filled: its first reading is so much earlier.
    start_s = 0.0037 - filtered.first_s
    assert shifted.first_s == pytest.approx(-start_s, abs=1e-9)
    for sampling in recording.metadata.sampling:
        np.testing.assert_allclose(sampling.steps[:6], STEP, rtol=1e-6)
        assert sampling.steps[6:] == (0.0, 0.0, 0.0)


def test_metadata_go_round(rng):
    recording = converted([np.arange(3000) / 100.0, 0.004 + np.arange(3000) / 100.0])
    text = recording.metadata.to_json()
    assert '"version": 3' in text
    assert RecordingMetadata.from_json(text) == recording.metadata
    assert RecordingMetadata.from_json(replace(recording.metadata, sampling=None).to_json()).sampling is None


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"native_hz": 0}, r"native_hz is 0; it must be a number of hertz"),
        ({"jitter_s": -1e-3}, r"jitter_s is -0\.001; it must be a number of seconds"),
        ({"missing": 1.0}, r"missing is 1\.0; it must be a share"),
        ({"aligned": 1}, r"aligned is 1; it must be true or false"),
        (
            {"method": "guessed"},
            r"method is 'guessed'; it must be one of untouched, filtered, interpolated, fitted",
        ),
        ({"level": "knee"}, r"level is 'knee'"),
        ({"steps": [0.0] * 8}, r"it must be 9 numbers, none negative"),
        ({"steps": [0.0] * 8 + [-1.0]}, r"it must be 9 numbers, none negative"),
        ({"bits": 12}, r"unknown key 'bits'"),
    ],
)
def test_values_are_checked(change, sentence):
    with pytest.raises(InputError, match=sentence):
        Sampling.from_dict(KNOWN.to_dict() | change, "x")
    assert Sampling.from_dict(KNOWN.to_dict(), "x") == KNOWN


def test_steps_of_wrist_positions_are_none_of_joints():
    wrist = replace(KNOWN, level="wrist")
    assert [tuple(wrist.steps_of(kind)) for kind in range(3)] == [(0.0,) * 3, (STEP,) * 3, (0.0,) * 3]


@pytest.mark.parametrize(
    ("native_hz", "jitter_s", "missing", "method"),
    [
        (100.0, 0.0, 0.0, "untouched"),
        (400.0, 0.0, 0.0, "filtered"),
        (50.0, 0.0, 0.0, "interpolated"),
        (130.0, 5e-4, 0.03, "interpolated"),
        (1000.0, 7e-4, 0.0, "fitted"),
    ],
)
def test_noise_of_readings_has_its_density_below_5_hz(rng, native_hz, jitter_s, missing, method):
    """White noise of variance one read at f has density 2 / f below any filter: a closed form, whatever the way."""
    sampling = replace(
        KNOWN, native_hz=native_hz, jitter_s=jitter_s, missing=missing, method=method, first_s=-0.0137
    )
    way = Resampling.of(sampling, 100.0, 6000, rng)
    made = way(rng.standard_normal((len(way.instants), 40)))
    assert made.shape == (6000, 40)
    band = butter(3, 5.0, fs=100.0, output="sos")
    frequency, gain = freqz_sos(band, 8192, fs=100.0)
    expected = 2.0 / (native_hz * (1 - missing)) * np.trapezoid(np.abs(gain) ** 4, frequency)
    found = np.var(sosfiltfilt(band, made, axis=0)[300:-300])
    assert found == pytest.approx(expected, rel=0.12)


def test_signals_pass_unchanged(rng):
    """Instants and grid belong together: what is read of a tone at the instants comes out as that tone."""
    for method in ("untouched", "filtered", "interpolated", "fitted"):
        sampling = replace(
            KNOWN, native_hz=100.0 if method == "untouched" else 400.0, method=method, missing=0.0
        )
        way = Resampling.of(sampling, 100.0, 800, rng)
        made = way(np.sin(2 * np.pi * 2.0 * way.instants)[:, None])[:, 0]
        np.testing.assert_allclose(made, np.sin(2 * np.pi * 2.0 * np.arange(800) / 100.0), atol=1e-6)


def test_steps_of_a_converted_recording_are_those_of_its_sensors():
    """What looks at the recording afterwards finds no step in the samples, and is told."""
    time = np.arange(3000) / 100.0
    recording = converted([time, time + 0.0037])
    steps = steps_of(recording, 5.0)
    assert steps.phi_rad == pytest.approx(STEP, rel=1e-6)
    assert steps.theta_rad == pytest.approx(STEP, rel=1e-6)
    values = np.concatenate([recording.phi, recording.theta, recording.tau], axis=2)
    streams = [stream(recording.time, values[:, i]) for i in range(2)]
    log = ArrayLog(streams, metadata=recording.metadata)
    for channels in survey(log).channels:
        assert [channel.step for channel in channels[:6]] == pytest.approx([STEP] * 6, rel=1e-6)
