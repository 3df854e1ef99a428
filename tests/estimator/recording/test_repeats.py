"""Rows that repeat the one before: told from equal readings, and refused in recordings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from estimator.errors import InputError
from estimator.quantisation import Repeats
from estimator.recording.model import Recording
from estimator.recording.parquet import read_recording, write_recording
from recordings import small_recording


def noisy(rng: np.random.Generator, rows: int = 4000, step: float = 0.0, noise: float = 0.01) -> np.ndarray:
    """A robot at rest: six encoders that stand and three torques."""
    tau = rng.normal(1.0, noise, (rows, 3))
    tau = np.round(tau / step) * step if step else tau
    return np.concatenate([np.full((rows, 6), 0.25), tau], axis=1)


def rows_of(recording: Recording, index: np.ndarray) -> Recording:
    fields = {name: getattr(recording, name)[index] for name in ("phi", "theta", "tau")}
    return replace(recording, time=np.arange(len(index)) / 100.0, ref=None, **fields)


@pytest.mark.parametrize("step", [0.0, 0.01])
@pytest.mark.parametrize("times", [2, 3, 40, 4000])
def test_a_reading_written_again_is_found(times: int, step: float) -> None:
    rng = np.random.default_rng(1)
    index = np.arange(8000) // times
    found = Repeats([6, 7, 8]).of(noisy(rng, step=step)[index])
    again = np.concatenate([[False], np.diff(index) == 0])
    assert np.mean(found[again]) > (0.97 if step else 1.0 - 1e-9)
    assert np.sum(found & ~again) < (0.03 * 8000 / times if step else 1)


def test_readings_that_are_equal_by_chance_stay() -> None:
    rng = np.random.default_rng(2)
    values = noisy(rng, step=0.02)
    assert np.sum(np.all(values[1:] == values[:-1], axis=1)) > 200
    assert not Repeats([6, 7, 8]).of(values).any()
    assert not Repeats([1]).of(np.round(rng.normal(0.0, 0.4, (4000, 2)) * [0.0, 1.0])).any()  # one joint


def test_a_resting_robot_without_noise_in_its_torques_repeats_itself() -> None:
    q = np.round(200 * np.sin(np.arange(4000) / 500.0))  # stairs of a coarse encoder, and a load in per cent
    stairs = np.column_stack([q, np.round(q / 80)])
    assert np.mean(np.all(stairs[1:] == stairs[:-1], axis=1)) > 0.5
    assert not Repeats([1]).of(stairs).any()
    assert not Repeats([]).of(np.zeros((3000, 2))).any()  # positions alone tell nothing


def test_blocks_do_not_matter() -> None:
    values = noisy(np.random.default_rng(3))[np.arange(6000) // 5]
    one, parts = Repeats([6, 7, 8]), Repeats([6, 7, 8])
    assert np.array_equal(one.of(values), np.concatenate([parts.of(values[:2048]), parts.of(values[2048:])]))


def test_a_recording_with_repeated_rows_is_refused(tmp_path) -> None:
    path = tmp_path / "stuck.parquet"
    write_recording(rows_of(small_recording(), np.minimum(np.arange(600), 400)), path)
    with pytest.raises(InputError, match="199 of 600 rows of omnid1 repeat the one before, first row 401"):
        read_recording(path)
    write_recording(rows_of(small_recording(), np.arange(600) - (np.arange(600) == 300)), path)
    assert len(read_recording(path).time) == 600  # one row changes nothing


def test_smooth_efforts_tell_nothing() -> None:
    """Noise-free motion between holds, as a simulation without sensors has it: equal rows are the robot's."""
    t = np.arange(4000) / 100.0
    hold = np.clip(np.sin(0.5 * t), -0.5, 0.5)  # moves, then rests
    values = np.column_stack([hold, np.cos(hold), 3.0 * hold**2])
    assert not Repeats([2]).of(values).any()
    noisy = values + np.array([0.0, 0.0, 0.01]) * np.random.default_rng(0).standard_normal(values.shape)
    noisy[1000:1400] = noisy[1000]
    assert Repeats([2]).of(noisy).sum() == 399
