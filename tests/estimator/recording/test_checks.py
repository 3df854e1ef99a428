"""What is checked in the samples, and what they tell of their sensors."""

from __future__ import annotations

import dataclasses
from dataclasses import replace

import numpy as np
import pytest

from estimator.arm.delta import inverse_kinematics
from estimator.errors import InputError
from estimator.quantisation import (
    Repeats,
    angle_of,
    filled,
    held_spans,
    without_held,
)
from estimator.recording.checks import check_duration, check_recording
from estimator.recording.model import Recording
from estimator.recording.parquet import read_recording, write_recording
from omnid_design import DESIGN
from recordings import small_recording

GOOD = small_recording()


def spoiled(field, index, value, recording=GOOD):
    array = getattr(recording, field).copy()
    array[index] = value
    return dataclasses.replace(recording, name="trial.parquet", **{field: array})


def complaint(recording):
    with pytest.raises(InputError) as caught:
        check_recording(recording)
    message = str(caught.value)
    assert message.startswith("trial.parquet: ")
    assert "\n" not in message
    return message


def test_a_good_recording_passes():
    check_recording(GOOD)
    check_recording(small_recording(rows=16, robots=1, ref=False))
    check_recording(small_recording(rows=16, robots=5))


@pytest.mark.parametrize("rows", [1, 15])
def test_too_few_rows(rows):
    recording = dataclasses.replace(small_recording(rows=rows), name="trial.parquet")
    assert complaint(recording) == f"trial.parquet: {rows} rows are too few; at least 16 are needed"


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize(
    ("field", "index", "column"),
    [
        ("time", (4,), "time"),
        ("phi", (4, 1, 2), "omnid2.phi3"),
        ("theta", (4, 0, 0), "omnid1.theta_z"),
        ("theta", (4, 2, 2), "omnid3.theta_x"),
        ("tau", (4, 2, 0), "omnid3.tau1"),
        ("ref", (4, 0, 1), "omnid1.ref_y"),
    ],
)
def test_values_that_are_not_finite(field, index, column, value):
    assert complaint(spoiled(field, index, value)) == (
        f"trial.parquet: column '{column}' is {value} in 1 of 600 rows, first in row 4; "
        "every value must be a finite number"
    )


def test_repeated_time():
    message = complaint(spoiled("time", 7, 0.06))
    assert message == "trial.parquet: time repeats in row 7 (from 0.06 s to 0.06 s); it must increase"


def test_time_that_goes_back():
    swapped = GOOD.time.copy()
    swapped[[7, 8]] = swapped[[8, 7]]
    message = complaint(spoiled("time", slice(None), swapped))
    assert message == "trial.parquet: time goes back in row 8 (from 0.08 s to 0.07 s); it must increase"


def test_a_gap_says_where_and_how_long():
    message = complaint(spoiled("time", slice(300, None), GOOD.time[300:] + 0.25))
    assert message == (
        "trial.parquet: a gap in time of 0.26 s before row 300 (from 2.99 s to 3.25 s); "
        "samples must be 0.005 to 0.015 s apart at 100 Hz"
    )


def test_driven_angles_in_degrees():
    message = complaint(spoiled("phi", slice(None), np.rad2deg(GOOD.phi)))
    assert f"column 'omnid1.phi1' reaches {np.rad2deg(GOOD.phi[:, 0, 0].max()):.6g} rad" in message
    assert "outside in 600 of 600 rows, first in row 0" in message
    assert message.endswith("range is -0.785398 to 1.5708 rad - the values look like degrees")


def test_gimbal_angles_in_degrees():
    message = complaint(spoiled("theta", slice(None), np.rad2deg(GOOD.theta)))
    assert "column 'omnid1.theta_z' reaches" in message
    assert message.endswith("range is -1 to 1 rad - the values look like degrees")


def test_encoders_that_start_again_after_a_turn():
    """Gimbals about their middle that read 0 to 2 pi: their values had been said to look like degrees."""
    centred = GOOD.theta - GOOD.theta.mean(axis=0)
    message = complaint(spoiled("theta", slice(None), np.mod(centred, 2 * np.pi)))
    assert "range is -1 to 1 rad - the values jump by a full turn" in message


@pytest.mark.parametrize(
    ("field", "suffix", "bound", "outward"),
    [("phi", "phi2", DESIGN.phi_min_rad, -1), ("phi", "phi2", DESIGN.phi_max_rad, 1)]
    + [("theta", "theta_y", sign * DESIGN.gimbal_limit_rad, sign) for sign in (-1, 1)],
)
def test_joint_limits_are_allowed_and_the_next_number_is_not(field, suffix, bound, outward):
    if field == "theta":
        check_recording(spoiled(field, (9, 1, 1), bound))
    beyond = bound + outward * 1e-6
    message = complaint(spoiled(field, (9, 1, 1), beyond))
    assert (
        f"column 'omnid2.{suffix}' reaches {beyond:.6g} rad (outside in 1 of 600 rows, first in row 9)"
        in message
    )
    assert "degrees" not in message


def test_legs_that_cannot_meet():
    short = dataclasses.replace(DESIGN, rod_length_m=0.25)
    recording = small_recording(design=short)
    phi = np.full_like(recording.phi, 1.3)
    phi[11, 2] = 0.2
    message = complaint(dataclasses.replace(recording, phi=phi, name="trial.parquet"))
    assert "omnid3 has phi = (0.2, 0.2, 0.2) rad in row 11, where the three rods cannot meet" in message


def test_a_leg_past_its_stretched_position():
    wide = dataclasses.replace(DESIGN, phi_max_rad=3.5)
    recording = dataclasses.replace(small_recording(design=wide), name="trial.parquet")
    phi = inverse_kinematics([0, 0, DESIGN.home_height_m], DESIGN)
    # The same wrist with knee 1 mirrored inward, in the line from driven axis to platform joint.
    inward = 2 * np.arctan2(DESIGN.home_height_m, DESIGN.platform_radius_m - DESIGN.base_radius_m) - phi[0]
    message = complaint(spoiled("phi", (11, 1, slice(None)), [inward, phi[1], phi[2]], recording))
    assert f"omnid2 has phi = ({inward:.6g}, 0.62303, 0.62303) rad in row 11" in message
    assert "where leg 1 is past its stretched position" in message


def test_duration_must_outlast_the_trim():
    check_duration(small_recording(rows=401), 2.0)
    recording = dataclasses.replace(small_recording(rows=400), name="trial.parquet")
    with pytest.raises(
        InputError, match=r"^trial.parquet: 400 samples are too few: dropping 2 s at each end"
    ):
        check_duration(recording, 2.0)


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


def test_a_recording_with_repeated_rows_is_refused(tmp_path) -> None:
    path = tmp_path / "stuck.parquet"
    write_recording(rows_of(small_recording(), np.minimum(np.arange(600), 400)), path)
    with pytest.raises(InputError, match="199 of 600 rows of omnid1 repeat the one before, first row 401"):
        read_recording(path)
    write_recording(rows_of(small_recording(), np.arange(600) - (np.arange(600) == 300)), path)
    assert len(read_recording(path).time) == 600  # one row changes nothing


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


@pytest.mark.parametrize("digits", [None, 5], ids=["fast", "five digits"])
def test_a_joint_that_turns_round_holds_no_reading(digits):
    """A coarse encoder at 250 Hz, whose values rarely repeat; a log of five digits, ten times coarser above 100."""
    time = np.arange(20000) / (250.0 if digits is None else 5000.0)
    x = sum(a * np.sin(w * time + p) for a, w, p in ((0.9, 1.3, 0.3), (0.3, 0.7, 1.1)))
    if digits is None:
        x, step = np.round(x / 5e-5) * 5e-5, 0.0
    else:
        x, step = np.array([float(f"{value:.{digits}g}") for value in 40.0 * x + 60.0]), 0.001
    out, held, doubt = filled(x[:, None], [step])
    assert not held
    assert not doubt.any()
    np.testing.assert_array_equal(out[:, 0], x)
