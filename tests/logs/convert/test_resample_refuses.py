"""What no resampling can mend is refused in one sentence that says where it is."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from array_log import ArrayLog, stream, tones
from estimator.errors import InputError
from mocobot_logs.log import Samples
from mocobot_logs.resample import resample

TIME = np.arange(3000) / 100.0
VALUES = tones(TIME, [1.0])
GOOD = stream(TIME, VALUES)


def refusal(*streams: Samples, rows: int = 700, **options) -> str:
    with pytest.raises(InputError) as error:
        resample(ArrayLog(streams, rows), **options)
    message = str(error.value)
    assert message.startswith("made.log: ")
    assert "\n" not in message
    return message


def changed(row: int, column: int, value: float) -> Samples:
    values = VALUES.copy()
    values[row, column] = value
    return stream(TIME, values)


def retimed(row: int, time_s: float) -> Samples:
    time = TIME.copy()
    time[row] = time_s
    return stream(time, VALUES)


@pytest.mark.parametrize("rows", [1, 700, 3000])
@pytest.mark.parametrize("value", [np.inf, -np.inf, 1e300])
def test_a_value_that_is_no_number(value, rows):
    message = refusal(GOOD, changed(1234, 5, value), rows=rows)
    assert f"robot 2: theta_x is {value} in row 1234, 12.34 s after its first sample" in message
    assert "finite" in message


@pytest.mark.parametrize("rows", [1, 700, 3000])
def test_rows_are_counted_with_those_that_lack_a_value(rows):
    bad = changed(1234, 5, np.inf)
    bad.values[[3, 800, 801, 1235], 2] = np.nan
    assert "theta_x is inf in row 1234, 12.34 s after its first sample" in refusal(GOOD, bad, rows=rows)


def test_nothing_but_rows_that_lack_a_value():
    bad = stream(TIME, np.where(np.arange(9) == 4, np.nan, VALUES))
    assert "robot 2 has 0 samples (3000 rows lack a value); at least 16" in refusal(GOOD, bad)


def test_the_first_of_several_faults_is_named():
    bad = changed(2000, 0, np.inf)
    bad.stamp_ns[1999] -= 10**9
    assert "runs back by 0.99 s in row 1999" in refusal(bad)
    bad = changed(1500, 0, np.inf)
    bad.stamp_ns[1999] -= 10**9
    assert "row 1500" in refusal(bad)


@pytest.mark.parametrize(("row", "rows"), [(1000, 1), (1000, 700), (1024, 1), (1024, 1024)])
def test_time_that_runs_back(row, rows):
    message = refusal(GOOD, retimed(row, TIME[row] - 0.5), rows=rows)
    at = f"row {row}, {TIME[row] - 0.5:.9g} s after its first sample"
    assert f"robot 2: time runs back by 0.49 s in {at}; stamps must increase" in message


@pytest.mark.parametrize(("row", "rows"), [(1000, 1), (1000, 700), (1024, 1), (1024, 1024)])
def test_one_time_with_two_values(row, rows):
    message = refusal(retimed(row, TIME[row - 1]), rows=rows)
    both = f"{VALUES[row - 1, 0]:.9g} and {VALUES[row, 0]:.9g}"
    assert f"phi1 is {both} at one time, in row {row}, {TIME[row - 1]:.9g} s after" in message


def test_a_gap():
    gone = np.r_[500:509]
    bad = stream(np.delete(TIME, gone), np.delete(VALUES, gone, axis=0))
    message = refusal(GOOD, GOOD, bad)
    assert "robot 3: no samples for 0.1 s, from 4.99 s after its first sample on" in message
    assert "0.01 s apart, and at most 0.08 s more may pass" in message
    assert resample(ArrayLog([bad]), max_gap_s=0.09).reports[0].filled == 9


def test_a_third_of_the_samples_missing():
    keep = np.sort(np.random.default_rng(1).permutation(3000)[:2100])
    gone = stream(TIME[keep], VALUES[keep])
    message = refusal(gone, max_gap_s=1.0)
    assert "samples are missing (30" in message
    assert "at most 10 % may be" in message


def test_uneven_stamps_are_no_loss():
    """125 Hz, a third of the period of jitter: one interval in nine is long, and as many are short."""
    time = np.sort(np.arange(6000) / 125.0 + 2.4e-3 * np.random.default_rng(2).standard_normal(6000))
    uneven = stream(time - time[0], tones(time, [1.0]))
    report = resample(ArrayLog([uneven]), 100.0).reports[0]
    assert report.filled > 660  # by intervals, more than a tenth


def test_a_rate_that_changes():
    """100 Hz first, then 1 kHz: its own filter would not hold for the second part."""
    time = np.concatenate(
        [np.arange(2000) / 100.0 + 1e-4 * (np.arange(2000) % 7), 20 + np.arange(20000) / 1000.0]
    )
    message = refusal(stream(time, tones(time, [1.0])), max_gap_s=100.0)
    assert "within a quarter of the usual" in message


UNIT = "25 to 20000 Hz are allowed (is the unit of time right?)"


@pytest.mark.parametrize(
    ("rate_hz", "words"),
    [
        (20.0, "25 to 20000 Hz are needed, so this log allows a rate of at most 80 Hz"),
        (0.1, f"at 0.1 Hz; {UNIT}"),
        (1e5, f"at 100000 Hz; {UNIT}"),
    ],
)
def test_too_slow_and_too_fast(rate_hz, words):
    """A log whose stamps can be true is not told that their unit is wrong."""
    time = np.arange(2000) / rate_hz
    assert refusal(stream(time, tones(time, [1.0]))).endswith(words)


@pytest.mark.parametrize("count", [0, 1, 2, 15])
def test_too_few_samples(count):
    assert f"robot 2 has {count} samples; at least 16" in refusal(
        GOOD, stream(TIME[:count], VALUES[:count]), rows=7
    )


def test_repeats_are_no_samples():
    assert "has 15 samples" in refusal(stream(np.append(TIME[:15], TIME[14]), VALUES[[*range(15), 14]]))


def test_too_short_for_the_filter():
    time = np.arange(300) / 1000.0
    assert "leaves 6 at 100 Hz; at least 16" in refusal(stream(time, tones(time, [1.0])))


def test_robots_without_a_time_in_common():
    late = stream(TIME, VALUES, start_ns=10**18)
    message = refusal(GOOD, late, GOOD)
    assert "robot 1 has 0.000 to 29.990 s and robot 2 has 1000000000.000 to 1000000029.990 s" in message
    assert "no time in common" in message
    assert "log" not in message.removeprefix("made.log")


def test_the_recorders_time_is_suggested_where_it_helps():
    log_ns = GOOD.stamp_ns + 5
    far = Samples(GOOD.stamp_ns + 10**12, VALUES, log_ns)
    assert 'clock = "log"' in refusal(Samples(GOOD.stamp_ns, VALUES, log_ns), far)
    apart = Samples(GOOD.stamp_ns + 10**12, VALUES, log_ns + 10**12)
    assert 'clock = "log"' not in refusal(Samples(GOOD.stamp_ns, VALUES, log_ns), apart)


def test_stamps_at_the_ends_of_their_range():
    """Differences of such stamps overflow."""
    stamp = np.concatenate([GOOD.stamp_ns[:100] + np.iinfo(np.int64).min, GOOD.stamp_ns[:100] + 2**62])
    message = refusal(Samples(stamp, VALUES[:200]))
    assert "leaps by 1.38350581e+10 s in row 100" in message


def test_crowding_rows_are_refused_before_anything_is_made_of_them():
    time = np.repeat(np.arange(8) / 100.0, 2)
    time[1::2] += 1e-6
    message = refusal(stream(time, VALUES[:16]))
    assert "allowed" in message or "within a quarter" in message


STEPS_NS = st.sampled_from(
    [10**7] * 12 + [10**7 + 300_000, 10**7 - 700_000, 2 * 10**7, 10**6, 1, 0, -1, 6 * 10**7, 10**12, 2**61]
)


@settings(max_examples=150, deadline=None)
@given(
    steps=st.lists(st.lists(STEPS_NS, min_size=0, max_size=60), min_size=1, max_size=3),
    spoil=st.sampled_from([0.0, 0.0, 0.0, np.nan, 1e99]),
    repeat=st.booleans(),
    rows=st.integers(1, 70),
)
def test_whatever_comes_ends_in_numbers_or_one_sentence(steps, spoil, repeat, rows):
    streams = []
    for robot in steps:
        stamp = np.cumsum(np.array([0, *robot], np.int64))  # may wrap around
        values = np.outer(np.ones(9) if repeat else np.arange(9.0), np.ones(len(stamp))).T
        values[len(stamp) // 2, 3] += spoil
        streams.append(Samples(stamp, values))
    message, result = "", None
    try:
        result = resample(ArrayLog(streams, rows))
    except InputError as error:
        message = str(error)
    if result is None:
        assert message.startswith("made.log: ")
        assert len(message) < 400
    else:
        assert all(np.isfinite(values).all() and len(values) >= 16 for values in result.values)
