"""Encoders that hold their last value: which readings are found to be held, and which are not."""

from dataclasses import replace

import numpy as np
import pytest

from estimator.filtering import differentiate, low_pass
from estimator.quantisation import angle_of, doubtful, held_spans, without_held
from estimator.recording.model import Recording
from recordings import small_recording

RATE_HZ, STEP = 100.0, 2.0 * np.pi / 2**16
TIME = np.arange(3000) / RATE_HZ
GAPS = ((400, 406), (900, 920), (1105, 1118), (1500, 1515), (2400, 2410))
"""First reading that is kept, and the first that is another."""


def rounded(x: np.ndarray) -> np.ndarray:
    return STEP * np.round(x / STEP + 0.3)


def sways() -> np.ndarray:
    """Up to 0.6 rad/s, at no gap slower than ten steps a sample."""
    return 0.4 + 0.2 * np.sin(2.0 * TIME) + 0.05 * np.sin(6.1 * TIME + 0.4)


def holding(x: np.ndarray, gaps=GAPS) -> np.ndarray:
    out = x.copy()
    for first, stop in gaps:
        out[first:stop] = out[first]
    return out


def moving_team(held: np.ndarray | None = None) -> Recording:
    """Three robots whose joints sway, each by itself; of robot 2 the second driven angle is given."""
    recording = small_recording(len(TIME))
    phases = np.arange(18).reshape(2, 1, 3, 3)
    angles = rounded(0.4 + 0.2 * np.sin(1.7 * TIME[:, None, None] + phases))
    phi = angles[0]
    if held is not None:
        phi[:, 1, 1] = held
    return replace(recording, phi=phi, theta=angles[1])


def test_every_gap_is_found_with_a_reading_more_at_either_end():
    assert held_spans(holding(rounded(sways())), STEP) == [(first, stop + 1) for first, stop in GAPS]


def test_one_more_reading_on_the_way_in_and_out_hides_no_gap():
    """What is resampled has a reading between the held value and the next."""
    x = holding(rounded(sways()))
    first, stop = GAPS[1]
    x[[first, stop - 1]] += STEP
    assert (first + 1, stop) in held_spans(x, STEP)


def test_a_joint_that_rested_before_is_held_no_longer_than_it_moves():
    still = np.maximum(TIME - 10.05, 0.0)
    x = holding(rounded(np.where(TIME < 14.0, 0.4 + 0.5 * still**2, sways())), ((1000, 1015), *GAPS[3:]))
    (start, stop), *_ = held_spans(x, STEP)
    assert stop == 1016
    assert 1000 <= start <= 1003


def sticks() -> np.ndarray:
    """It comes to rest under friction, stays, breaks away faster and faster, and so on."""
    speed = np.maximum(np.abs(np.sin(1.3 * TIME)) - 0.4, 0.0) * np.sign(np.sin(1.3 * TIME))
    return np.cumsum(speed) / RATE_HZ


def behind_a_gap() -> np.ndarray:
    """An encoder behind a gear with play stands at every turn."""
    out, at = [], 0.0
    for x in sways():
        at = min(max(at, x - 2e-3), x + 2e-3)
        out.append(at)
    return np.array(out)


@pytest.mark.parametrize(
    "x",
    [
        sways(),
        1e-3 * sways(),
        np.full(len(TIME), 0.3),
        sticks(),
        behind_a_gap(),
        0.2 * np.clip(np.sin(TIME), -0.5, 0.5),
        1e-4 * np.random.default_rng(3).standard_normal(len(TIME)),
    ],
    ids=["moves", "creeps", "rests", "sticks", "play", "stops", "noise"],
)
def test_what_a_moving_angle_does_is_not_held(x):
    assert held_spans(rounded(x), STEP) == []


def test_held_readings_are_interpolated_onto_the_encoders_steps():
    true = rounded(sways())
    recording, (held,), doubt = without_held(moving_team(holding(true)))
    assert angle_of(held.column, 3) == (0, 1, 1)
    assert len(held.spans) == len(GAPS)
    assert held.nats > 100.0
    off = (recording.phi[:, 1, 1] - true) / STEP
    np.testing.assert_allclose(off, np.round(off), atol=1e-6)
    spoilt = holding(true) != true
    assert np.abs(off).max() < 0.05 * np.abs((holding(true) - true) / STEP).max()
    assert set(np.flatnonzero(off)) <= set(np.flatnonzero(doubt)) | set(np.flatnonzero(np.abs(off) < 1.5))
    assert np.all(
        np.isin(np.flatnonzero(doubt > 1.0), np.flatnonzero(np.convolve(spoilt, np.ones(5), "same") > 0))
    )


def test_a_team_that_moves_is_as_it_was_read():
    recording = moving_team()
    same, held, doubt = without_held(recording)
    assert not held
    assert not doubt.any()
    np.testing.assert_array_equal(same.phi, recording.phi)


def test_readings_that_scatter_by_more_than_their_steps_are_none_that_are_held():
    """Some are equal by chance, where the joint is about to turn."""
    rng = np.random.default_rng(4)
    for _ in range(200):
        recording = moving_team(rounded(sways() + rng.normal(0.0, STEP, len(TIME))))
        assert not without_held(recording)[1]


def test_an_encoder_slower_than_the_log_is_left_as_it_is():
    slow = rounded(sways())[np.arange(len(TIME)) // 10 * 10]
    assert not without_held(moving_team(slow))[1]


def test_beyond_doubtful_samples_held_readings_change_less_than_noise():
    """In value, rate and acceleration of the filtered angle."""
    true = rounded(sways())
    recording, _, doubt = without_held(moving_team(holding(true)))
    kept = ~doubtful(doubt, RATE_HZ, 5.0)
    assert 0.3 < kept.mean() < 0.95
    off, noise = recording.phi[:, 1, 1] - true, true - (sways() + 0.3 * STEP)
    for _ in range(3):
        changed, usual = (low_pass(x, RATE_HZ, 5.0) for x in (off, noise))
        assert np.abs(changed[kept]).max() < 2.0 * usual.std()
        off, noise = (differentiate(x, RATE_HZ) for x in (off, noise))
