"""Every fault of a recording gets one sentence with file, column, row, value and what is allowed."""

import dataclasses

import numpy as np
import pytest

from estimator.arm.delta import inverse_kinematics
from estimator.errors import InputError
from estimator.recording.checks import RATE_TOLERANCE, check_duration, check_recording
from omnid_design import DESIGN
from recordings import metadata, small_recording

GOOD = small_recording()
ROWS = len(GOOD.time)


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


def test_missing_rows_are_counted():
    message = complaint(spoiled("tau", (slice(20, 50), 0, 1), np.nan))
    assert "'omnid1.tau2' is nan in 30 of 600 rows, first in row 20" in message


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


def test_one_lost_row_is_a_gap():
    keep = np.delete(np.arange(ROWS), 100)
    short = dataclasses.replace(small_recording(rows=ROWS - 1), time=GOOD.time[keep], name="trial.parquet")
    assert "a gap in time of 0.02 s before row 100 (from 0.99 s to 1.01 s)" in complaint(short)


def test_crowded_samples():
    assert "a crowding in time of 0.004 s before row 7" in complaint(spoiled("time", 7, 0.064))


def test_jitter_within_half_a_period_passes():
    rng = np.random.default_rng(0)
    check_recording(spoiled("time", slice(None), GOOD.time + rng.uniform(-0.0024, 0.0024, ROWS)))


@pytest.mark.parametrize("rate", [50.0, 200.0, 1000.0])
def test_another_rate_is_not_reported_as_a_gap(rate):
    message = complaint(dataclasses.replace(GOOD, metadata=metadata(rate_hz=rate), name="trial.parquet"))
    assert f"samples are 0.01 s apart, but rate_hz is {rate:g}" in message


def test_a_slightly_wrong_rate():
    rows = 6000
    long = small_recording(rows=rows)
    slow = spoiled("time", slice(None), long.time * (1 + 2 * RATE_TOLERANCE), long)
    assert "samples come at 99.8004 Hz on average, but rate_hz is 100" in complaint(slow)
    check_recording(spoiled("time", slice(None), long.time * (1 + 0.5 * RATE_TOLERANCE), long))


def test_time_may_start_anywhere():
    check_recording(spoiled("time", slice(None), GOOD.time + 1.7e9))


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


def test_a_jump_over_the_limit_is_not_called_degrees():
    assert "degrees" not in complaint(spoiled("phi", (9, 0, 0), 1.58))
    assert "degrees" not in complaint(spoiled("phi", (9, 0, 0), 400.0))


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
