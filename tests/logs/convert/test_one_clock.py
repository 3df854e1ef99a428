"""Logs of several clocks on one: bit for bit where nothing is to be done, closed forms where there is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from array_log import ArrayLog, stream, tones
from estimator.arm.wrist_level import wrist_of
from estimator.errors import InputError
from mocobot_logs.log import CHANNELS, REF, Samples
from mocobot_logs.one_clock import to_recording
from mocobot_logs.resample import resample
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


def expected_tone(result, start_s):
    return tones(start_s + result.time, [5.0], 6)


def test_grids_between_each_other():
    """Robot 2 samples 3.7 ms later; stamps are right."""
    result, report = made(moving(starts_s=(0.0, 0.1037)))
    assert report.untouched == (True, False)
    assert report.start_s == pytest.approx(0.11)
    np.testing.assert_allclose(report.lost_s, [[0.11, 0.0], [0.0063, 0.0037]], rtol=0, atol=1e-9)
    tone = expected_tone(result, report.start_s)
    np.testing.assert_allclose(result.phi[:, 0], tone[:, :3], rtol=0, atol=1e-12)
    error = np.abs(result.tau[:, 1] - tone[:, 3:])
    assert error[20:-20].max() < 1e-7
    assert error.max() < 2e-5


@pytest.mark.parametrize(("late_s", "same"), [(0.9e-6, True), (-0.9e-6, True), (2e-6, False)])
def test_stamps_within_a_microsecond_are_the_same(late_s, same):
    log = moving(starts_s=(0.1, 0.1 + late_s))
    result, report = made(log)
    assert report.untouched == (True, same)
    if same:
        np.testing.assert_array_equal(result.tau[:, 1], log.streams[1].values[: len(result.time), 6:])


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


def test_a_late_start_shortens_the_recording():
    result, report = made(moving(starts_s=(0.0, 7.0)))
    assert (len(result.time), result.time[0]) == (3300, 0.0)
    np.testing.assert_allclose(report.lost_s, [[7.0, 0.0], [0.0, 0.0]], rtol=0, atol=1e-12)


def test_one_robot():
    streams = moving().streams[:1]
    result, report = made(ArrayLog(streams), correct=True)
    np.testing.assert_array_equal(result.theta[:, 0], streams[0].values[:, 3:6])
    assert report.untouched == (True,)


# --- refused


def test_a_log_that_ends_early():
    message = refused(moving(ends_s=(40.0, 31.5)))
    assert "the log of robot 2 ends 8.5 s before that of robot 1; at most 1 s is allowed" in message
    assert "clock" not in message
    made(moving(ends_s=(40.0, 39.1)))


def test_a_clock_that_makes_a_log_seem_to_end_early():
    log = moving((0.0, -4.0), ends_s=(40.0, 36.0), starts_s=(4.0, 0.0))
    message = refused(log)
    assert "the log of robot 2 ends 4 s before that of robot 1" in message
    assert "the clock of robot 2 differs from that of robot 1 by -4 s: correct the clocks" in message
    result, report = made(log, correct=True)
    assert len(result.time) > 3590
    np.testing.assert_allclose(report.lost_s, 0.0, atol=0.011)


def test_clocks_that_cannot_be_corrected():
    still = [Samples(s.stamp_ns, np.broadcast_to(s.values[:1], s.values.shape)) for s in moving().streams]
    message = refused(ArrayLog(still), correct=True)
    assert "the clock of robot 2 cannot be told from the motion and so not be corrected: " in message
    made(ArrayLog(still))


def test_hardly_anything_in_common():
    message = refused(moving(starts_s=(0.0, 39.9), ends_s=(40.0, 40.3)))
    assert "the robots have 10 samples in common; at least 16" in message


@pytest.mark.parametrize("key", ["design", "trial"])
def test_what_nobody_says(key):
    assert f"says nothing about its {key}, which must be given" in refused(moving(), **{key: None})


def test_a_wrist_out_of_reach(random_a):
    log = log_of(measure(random_a, PRESETS["nominal"], np.random.default_rng(1)), "wrist")
    log.streams[1].values[200:, 2] *= 1000.0  # mm
    with pytest.raises(
        InputError, match=r"made.log: robot 2, 2 s after the recording's beginning: leg . cannot reach"
    ):
        to_recording(resample(log))
