"""One clock for all robots, and what a recording tells of how its sensors were read."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, freqz_sos, sosfiltfilt

from array_log import ArrayLog, stream, tones
from estimator.arm.delta import wrist_of
from estimator.errors import InputError
from estimator.estimate.leftover import steps_of
from estimator.recording.metadata import Sampling
from mocobot_inspect.survey import survey
from mocobot_logs.log import CHANNELS, REF, Samples
from mocobot_logs.one_clock import to_recording
from mocobot_logs.resample import resample
from mocobot_logs.resample_filter import Resampling
from mocobot_sim.trial.sensors import PRESETS, measure
from omnid_design import DESIGN
from recordings import metadata
from turning_body import theta_at

EPOCH_NS = 1_700_000_000_000_000_000
MIDDLE_S = 20.0
GIVEN = {"design": DESIGN, "trial": "random"}


def log_of(recording, level="joint"):
    """The recording's samples as a log; with its commands at joint level."""
    streams = []
    for i in range(recording.metadata.robots):
        parts = [recording.phi[:, i], recording.theta[:, i], recording.tau[:, i]]
        if level == "wrist":
            parts[::2] = wrist_of(parts[0], parts[2], DESIGN)
        elif recording.ref is not None:
            parts.append(recording.ref[:, i])
        streams.append(stream(recording.time, np.concatenate(parts, axis=1), EPOCH_NS))

    class Log(ArrayLog):
        channels = CHANNELS[level] + (REF if streams[0].values.shape[1] > 9 else ())

    return Log(streams, level=level, metadata=recording.metadata)


def true_time(stamp, offset_s, drift):
    """Of stamps by a clock of which stamp = true + offset + drift (true - middle)."""
    return MIDDLE_S + (stamp - MIDDLE_S - offset_s) / (1.0 + drift)


def moving(
    offset_s=(0.0, 0.0),
    drift=(0.0, 0.0),
    starts_s=(0.0, 0.0),
    ends_s=(40.0, 40.0),
):
    """Robots that hold a turning body; angles and torques are a tone, of the true time."""
    streams = []
    for i in range(len(offset_s)):
        stamp = starts_s[i] + np.arange(round(100 * (ends_s[i] - starts_s[i]))) / 100.0
        true = true_time(stamp, offset_s[i], drift[i])
        tone = tones(true, [5.0], 6)
        streams.append(
            stream(stamp, np.concatenate([tone[:, :3], theta_at(true, i), tone[:, 3:]], axis=1), EPOCH_NS)
        )
    return ArrayLog(streams)


def made(log, **options):
    return to_recording(resample(log), **(GIVEN | options))


def refused(log, **options) -> str:
    with pytest.raises(InputError) as error:
        made(log, **options)
    assert str(error.value).startswith("made.log: ")
    return str(error.value)


# --- nothing to be done


def test_a_recording_comes_back_bit_for_bit(random_a):
    recording = measure(random_a, PRESETS["nominal"], np.random.default_rng(1), payload="a", seed=7)
    result, report = to_recording(resample(log_of(recording)))
    for field in ("time", "phi", "theta", "tau", "ref"):
        np.testing.assert_array_equal(getattr(result, field), getattr(recording, field))
    assert result.metadata == recording.metadata
    assert (report.untouched, report.corrected) == ((True,) * 3, False)
    np.testing.assert_array_equal(report.lost_s, 0.0)
    assert np.abs(report.estimate.offset_s).max() < 5e-5


def test_wrist_level_becomes_joint_level_in_memory(random_a):
    recording = measure(random_a, PRESETS["nominal"], np.random.default_rng(1))
    result, _ = to_recording(resample(log_of(recording, "wrist")))
    np.testing.assert_array_equal(result.theta, recording.theta)
    np.testing.assert_allclose(result.phi, recording.phi, rtol=0, atol=1e-13)
    np.testing.assert_allclose(result.tau, recording.tau, rtol=0, atol=1e-12)
    assert result.metadata == replace(recording.metadata, level="wrist")


def test_what_is_given_takes_the_place_of_what_the_log_says():
    log = moving()
    log.metadata = metadata(robots=2, trial="static", seed=3, control={"rate_hz": 1000.0})
    result, _ = to_recording(resample(log), trial="periodic", payload="box", source="lab")
    assert result.metadata == replace(log.metadata, trial="periodic", payload="box", source="lab")
    plain, _ = made(moving(), payload="box")
    assert plain.metadata == metadata(robots=2, payload="box", source="log made.log")


# --- other grids, other clocks


def test_correction_undoes_offset_and_drift():
    """Against the tone of 5 Hz: at the instants that the estimate stands for to 1e-7, at the true ones to its error."""
    skew = (0.0, 0.0234, -1.71), (0.0, 5e-5, -2e-4)
    log = moving(*skew, (3.0, 1.0, 0.5), (37.0, 37.3, 35.6))
    result, report = made(log, correct=True)
    assert (report.corrected, report.untouched) == (True, (True, False, False))
    origin_s = 0.5  # the earliest stamp
    time_s = origin_s + report.start_s + result.time
    estimate = report.estimate
    late_s = estimate.middle_s + origin_s - MIDDLE_S
    offset_s = np.array(skew[0]) + late_s * np.array(skew[1])
    np.testing.assert_allclose(estimate.offset_s, offset_s, rtol=0, atol=2e-7)
    np.testing.assert_allclose(estimate.drift, skew[1], rtol=0, atol=3e-8)
    for i in range(3):
        stamp = origin_s + estimate.stamps(i, time_s - origin_s)
        claimed = true_time(stamp, skew[0][i], skew[1][i])
        assert np.abs(claimed - time_s).max() < 6e-7
        inner = slice(20, -20)
        for values, exact in (
            (result.phi, tones(claimed, [5.0], 3)),
            (result.tau, tones(claimed, [5.0], 6)[:, 3:]),
            (result.theta, theta_at(claimed, i)),
        ):
            np.testing.assert_allclose(values[inner, i], exact[inner], rtol=0, atol=1e-7)
        np.testing.assert_allclose(result.phi[inner, i], tones(time_s, [5.0], 3)[inner], rtol=0, atol=2e-5)


def test_kept_clocks_keep_their_error():
    result, report = made(moving((0.0, 0.02)))
    assert report.untouched == (True, True)
    np.testing.assert_allclose(result.theta[:, 1], theta_at(result.time - 0.02, 1), rtol=0, atol=1e-12)
    assert report.estimate.offset_s[1] == pytest.approx(0.02, abs=1e-7)


# --- refused


def test_clocks_that_cannot_be_corrected():
    still = [Samples(s.stamp_ns, np.broadcast_to(s.values[:1], s.values.shape)) for s in moving().streams]
    message = refused(ArrayLog(still), correct=True)
    assert "the clock of robot 2 cannot be told from the motion and so not be corrected: " in message
    made(ArrayLog(still))


def test_a_wrist_out_of_reach(random_a):
    log = log_of(measure(random_a, PRESETS["nominal"], np.random.default_rng(1)), "wrist")
    log.streams[1].values[200:, 2] *= 1000.0  # mm
    with pytest.raises(
        InputError, match=r"made.log: robot 2, 2 s after the recording's beginning: leg . cannot reach"
    ):
        to_recording(resample(log))


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
