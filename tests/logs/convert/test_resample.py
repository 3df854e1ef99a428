"""Resampling: against signals that are known, whatever pieces come; gaps, uneven stamps, and what is refused."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.polynomial import Polynomial

import mocobot
from array_log import ArrayLog, stream, tones
from estimator.errors import InputError
from mocobot.options import Convert
from mocobot_logs.log import Samples
from mocobot_logs.resample import MAX_GAP_S, Resampled, resample
from mocobot_logs.resample_filter import Grid, Interpolator, low_pass_taps

EPOCH_NS = 1_700_000_000_123_456_789
BAND_HZ = (0.7, 3.0, 5.0, 19.0)


def one_robot(time_s, values, rows: int = 1000) -> Resampled:
    return resample(ArrayLog([stream(time_s, values, EPOCH_NS)], rows))


def grid_s(resampled: Resampled, robot: int = 0) -> np.ndarray:
    """Instants of a robot's grid after the log's first stamp."""
    return resampled.start_s[robot] + np.arange(len(resampled.values[robot])) / resampled.rate_hz


def jittered(rate_hz, duration_s, share, drop=0.0, seed=0):
    """Times off their places by up to a share of a period; some dropped."""
    rng = np.random.default_rng(seed)
    count = round(duration_s * rate_hz)
    time = (np.arange(count) + np.append(0.0, rng.uniform(-share, share, count - 1))) / rate_hz
    gone = rng.choice(np.arange(1, count - 1), round(drop * count), replace=False)
    return np.delete(time, gone)


# --- what is on the grid stays as it is


@pytest.mark.parametrize("off_ns", [0, 400, 1000])
def test_samples_on_the_grid_are_untouched(off_ns):
    rng = np.random.default_rng(1)
    values = rng.normal(size=(9000, 9))
    stamp = EPOCH_NS + 10_000_000 * np.arange(9000) + off_ns * rng.integers(0, 2, 9000)
    stamp[0] = EPOCH_NS
    result = resample(ArrayLog([Samples(stamp, values)], 777))
    np.testing.assert_array_equal(result.values[0], values)
    assert (result.origin_ns, result.start_s[0]) == (EPOCH_NS, 0.0)
    report = result.reports[0]
    assert (report.method, report.filled, report.gaps, report.duplicates) == ("untouched", 0, 0, 0)
    assert report.native_hz == pytest.approx(100.0, rel=1e-7)
    assert report.jitter_max_s == pytest.approx(off_ns * 1e-9, abs=1e-12)


def test_dropped_samples_of_a_grid_are_filled_and_the_others_untouched():
    time = np.arange(5000) / 100.0
    values = tones(time, (0.5, 2.0))
    gone = np.r_[100, 200:202, 4000:4005, 4096, 4998]
    result = one_robot(np.delete(time, gone), np.delete(values, gone, axis=0))
    kept = np.delete(np.arange(5000), gone)
    np.testing.assert_array_equal(result.values[0][kept], values[kept])
    np.testing.assert_allclose(result.values[0][gone], values[gone], rtol=0, atol=2e-4)
    report = result.reports[0]
    assert (report.method, report.filled, report.gaps) == ("untouched", 10, 5)
    assert report.longest_gap_s == pytest.approx(0.05, abs=1e-9)
    assert report.filled_share == pytest.approx(10 / 5000)


# --- accuracy


@pytest.mark.parametrize(
    ("rate_hz", "share", "tolerance"),
    [
        (50.0, 0.0, 0.12),  # 19 Hz is close to half of that rate
        (97.3, 0.0, 3e-4),
        (100.0, 0.2, 2e-3),
        (100.5, 0.05, 4e-4),
        (130.0, 0.1, 1e-4),
        (333.3, 0.1, 1e-5),
        (1000.0, 0.0, 1e-5),
        (1000.0, 0.1, 1e-5),
        (1999.7, 0.1, 1e-5),
    ],
)
def test_the_band_comes_through_at_its_place_in_time(rate_hz, share, tolerance):
    """Sines up to 19 Hz against their closed form: gain and delay at once, ends included."""
    time = jittered(rate_hz, 6.0, share)
    result = one_robot(time, tones(time, BAND_HZ))
    np.testing.assert_allclose(result.values[0], tones(grid_s(result), BAND_HZ), rtol=0, atol=tolerance)


def low_band_amplitude(values: np.ndarray) -> float:
    """Largest amplitude below 20 Hz, through a window whose side lobes are below -92 dB."""
    window = np.blackman(len(values)) ** 2
    spectrum = 2.0 * np.abs(np.fft.rfft(window[:, None] * values, axis=0)) / window.sum()
    return float(spectrum[: int(0.2 * len(values)) - 12].max())


@pytest.mark.parametrize(
    "rate_hz", [101.3, 110.0, 147.0, 210.0, 250.0, 333.3, 499.0, 505.0, 640.0, 1000.0, 1003.7]
)
def test_nothing_folds_below_20_hz(rate_hz):
    """Tones from just above 25 Hz to half the native rate, one per channel, leave less than -80 dB there."""
    time = np.arange(round(8 * rate_hz)) / rate_hz
    for frequencies in np.array_split(np.linspace(25.0, rate_hz / 2 - 0.1, 120), 10):
        result = one_robot(
            time, np.sin(2 * np.pi * time[:, None] * frequencies + np.arange(len(frequencies)))
        )
        assert result.reports[0].method == ("filtered" if rate_hz == 1000.0 else "interpolated")
        assert low_band_amplitude(result.values[0]) < 1e-4


# --- blocks and chunks


def made_stream(kind: str) -> Samples:
    rng = np.random.default_rng(3)
    time = {
        "untouched": np.arange(6000) / 100.0,
        "filtered": np.arange(6000) / 300.0,
        "interpolated": jittered(130.0, 50.0, 0.2),
        "merged": np.sort(np.append(np.arange(6000) / 120.0, np.arange(1, 300) / 6.0 + 1e-3)),
    }[kind]
    gone = rng.choice(np.arange(1, len(time) - 1), len(time) // 50, replace=False)
    time = np.delete(time, gone)
    return stream(time, rng.normal(size=(len(time), 3)), EPOCH_NS)


@pytest.mark.parametrize("kind", ["untouched", "filtered", "interpolated", "merged"])
@settings(max_examples=15, deadline=None)
@given(cuts=st.lists(st.integers(0, 6500), max_size=12))
def test_pieces_change_nothing(kind, cuts):
    whole = made_stream(kind)

    class Pieces(ArrayLog):
        def chunks(self, advance):
            edges = [0, *sorted(cuts), len(whole.stamp_ns)]
            for a, b in pairwise(edges):
                yield 0, Samples(whole.stamp_ns[a:b], whole.values[a:b])

    expected, result = resample(ArrayLog([whole], 10**6)), resample(Pieces([whole]))
    np.testing.assert_array_equal(result.values[0], expected.values[0])
    assert result.start_s[0] == expected.start_s[0]
    mine, theirs = result.reports[0].to_dict(), expected.reports[0].to_dict()
    assert mine.pop("jitter_rms_s") == pytest.approx(theirs.pop("jitter_rms_s"), rel=1e-9)
    assert mine == theirs
    assert (mine["merged"] > 0) == (kind == "merged")


# --- faults that are mended


@pytest.mark.parametrize("piece", [1, 1000, 1024, 5000])
def test_duplicates_are_dropped_and_counted(piece):
    time = np.arange(3000) / 100.0
    values = tones(time, BAND_HZ)
    rows = np.sort(np.append(np.arange(3000), [5, 5, 999, 1020, 2999]))
    assert rows[1023] == rows[1024]  # in two pieces
    result = one_robot(time[rows], values[rows], rows=piece)
    np.testing.assert_array_equal(result.values[0], values)
    assert (result.reports[0].duplicates, result.reports[0].samples) == (5, 3005)


@pytest.mark.parametrize("k", [2, 3, 7, 10, 30])
def test_low_pass_is_what_it_says(k):
    taps = low_pass_taps(k)
    frequency = np.linspace(0.0, k / 2, 1000 * k + 1)[:5000]  # in output rates
    time = np.arange(len(taps)) - len(taps) // 2
    gain = np.cos(2 * np.pi * np.multiply.outer(frequency, time / k)) @ taps  # symmetric: real
    np.testing.assert_array_equal(taps, taps[::-1])
    assert np.abs(gain[frequency <= 0.2] - 1.0).max() < 5e-6
    assert np.abs(gain[frequency >= 0.5]).max() < 10 ** (-108 / 20)


def test_four_in_a_row_lost_at_50_hz_are_filled_within_the_sensors_noise():
    """Coarse encoders (12 bits) err by 0.44 mrad, good ones (17 bits) by 14 urad; torques by 3 mN m and more."""
    trial = mocobot.simulate(payload="c", vias=12, preset="ideal", seed=5)
    time, robot = trial.time[::2], 1
    values = np.concatenate([trial.phi[::2, robot], trial.theta[::2, robot], trial.tau[::2, robot]], axis=1)
    first = np.arange(60, len(time) - 60, 90)
    gone = (first[:, None] + np.arange(4)).ravel()
    log = ArrayLog([stream(np.delete(time, gone), np.delete(values, gone, axis=0))])
    found = resample(log, rate_hz=50.0)
    assert found.reports[0].filled == len(gone) > 8
    error = (found.values[0] - values)[gone]
    assert np.sqrt(np.mean(error[:, :6] ** 2)) < 14e-6
    assert np.sqrt(np.mean(error[:, 6:] ** 2)) < 10e-3
    assert np.abs(error).max() > 0.0


def test_the_command_has_the_same_limit():
    assert Convert.__dataclass_fields__["max_gap_s"].default == MAX_GAP_S


RATE_HZ = 1000.0


@pytest.fixture
def rng():
    return np.random.default_rng(11)


def poisson(rng, duration_s: float = 20.0) -> np.ndarray:
    """Times in order that know nothing of each other, RATE_HZ of them a second, none less than 20 us apart."""
    time = np.sort(rng.uniform(0.0, duration_s, round(RATE_HZ * duration_s)))
    return time[np.concatenate([[True], np.diff(time) > 2e-5])]


def test_values_are_those_of_the_polynomial_nearest_to_the_nearest_rows(rng):
    time, spacing = poisson(rng), 0.8e-3
    time -= time[0]
    values = rng.standard_normal((len(time), 2))
    interpolator = Interpolator(Grid(spacing * 1e9, 1e9 / RATE_HZ, fitted_rows=12), 0.05)
    stamps = np.rint(time * 1e9).astype(np.int64)
    blocks = [
        b
        for part in np.array_split(np.arange(len(time)), 7)
        for b in interpolator.push(stamps[part], values[part])
    ]
    found = np.concatenate([*blocks, interpolator.finish()])
    for k in rng.integers(50, len(found) - 50, 40):
        first = np.searchsorted(stamps * 1e-9, k * spacing) - 6
        near = slice(first, first + 12)
        expected = [Polynomial.fit(time[near], y, 5)(k * spacing) for y in values[near].T]
        np.testing.assert_allclose(found[k], expected, rtol=1e-5, atol=1e-5)


def test_tones_of_the_payload_pass(rng):
    time = poisson(rng)
    result = resample(ArrayLog([stream(time, tones(time, (0.7, 3.0, 5.0)))]))
    report = result.reports[0]
    assert (report.method, report.filled, report.gaps, report.merged) == ("fitted", 0, 0, 0)
    assert report.native_hz == pytest.approx(RATE_HZ, rel=0.03)
    at = result.start_s[0] + time[0] + np.arange(len(result.values[0])) / 100.0
    np.testing.assert_allclose(result.values[0], tones(at, (0.7, 3.0, 5.0)), rtol=0, atol=2e-5)


def test_noise_is_averaged_nearly_as_over_even_samples(rng):
    """A quarter more at instants that know nothing of each other; polynomials through 12 leave twice as much."""
    time = poisson(rng, 60.0)
    noise = rng.standard_normal((len(time), 9))
    low = resample(ArrayLog([stream(time, noise)])).values[0]
    below_5_hz = np.abs(np.fft.rfft(low, axis=0)[1:300]) ** 2
    spectrum = np.mean(below_5_hz) / len(low) / 100.0
    assert 0.9 < spectrum * RATE_HZ < 1.35


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


def at_rate(rate_hz: float, count: int) -> Samples:
    time = np.arange(count) / rate_hz
    return stream(time, tones(time, [1.0]))


def without(rows: Sequence[int]) -> Samples:
    return stream(np.delete(TIME, rows), np.delete(VALUES, rows, axis=0))


def infinite(row: int, *, back: bool = False, blank: Sequence[int] = ()) -> Samples:
    bad = changed(row, 5, np.inf)
    bad.values[list(blank), 2] = np.nan
    bad.stamp_ns[1999] -= 10**9 * back
    return bad


def slower_first() -> Samples:
    """100 Hz first, then 1 kHz: its own filter would not hold for the second part."""
    slow = np.arange(2000) / 100.0 + 1e-4 * (np.arange(2000) % 7)
    time = np.concatenate([slow, 20 + np.arange(20000) / 1000.0])
    return stream(time, tones(time, [1.0]))


def crowding() -> Samples:
    time = np.repeat(np.arange(8) / 100.0, 2)
    time[1::2] += 1e-6
    return stream(time, VALUES[:16])


def at_the_ends_of_the_range() -> Samples:
    """Differences of such stamps overflow."""
    ends = GOOD.stamp_ns[:100] + np.iinfo(np.int64).min, GOOD.stamp_ns[:100] + 2**62
    return Samples(np.concatenate(ends), VALUES[:200])


UNIT = "25 to 20000 Hz are allowed (is the unit of time right?)"
THIRD = np.sort(np.random.default_rng(1).permutation(3000)[2100:])
ROW = "row 1234, 12.34 s after its first sample"
FAULTS: dict[str, tuple[Samples, dict[str, float], list[str]]] = {
    "infinite": (changed(1234, 5, np.inf), {}, [f"robot 2: theta_x is inf in {ROW}; every value must be a finite"]),
    "minus infinite": (changed(1234, 5, -np.inf), {}, [f"robot 2: theta_x is -inf in {ROW}"]),
    "huge": (changed(1234, 5, 1e300), {}, [f"robot 2: theta_x is 1e+300 in {ROW}"]),
    "rows that lack a value count": (infinite(1234, blank=(3, 800, 801, 1235)), {}, [f"theta_x is inf in {ROW}"]),
    "nothing but such rows": (
        stream(TIME, np.where(np.arange(9) == 4, np.nan, VALUES)), {},
        ["robot 2 has 0 samples (3000 rows lack a value); at least 16"],
    ),
    "time before value": (infinite(2000, back=True), {}, ["runs back by 0.99 s in row 1999"]),
    "value before time": (infinite(1500, back=True), {}, ["row 1500"]),
    "time runs back": (
        retimed(1000, TIME[1000] - 0.5), {},
        ["robot 2: time runs back by 0.49 s in row 1000, 9.5 s after its first sample; stamps must increase"],
    ),
    "time runs back where the rate is known": (retimed(1024, TIME[1024] - 0.5), {}, ["by 0.49 s in row 1024, 9.74 s"]),
    "one time with two values": (
        retimed(1000, TIME[999]), {},
        [f"phi1 is {VALUES[999, 0]:.9g} and {VALUES[1000, 0]:.9g} at one time, in row 1000, 9.99 s after"],
    ),
    "one time with two values, later": (retimed(1024, TIME[1023]), {}, ["at one time, in row 1024, 10.23 s after"]),
    "a gap": (
        without(range(500, 509)), {},
        ["robot 2: no samples for 0.1 s, from 4.99 s after its first sample on",
         "0.01 s apart, and at most 0.08 s more may pass"],
    ),
    "a third missing": (without(THIRD), {"max_gap_s": 1.0}, ["samples are missing (30", "at most 10 % may be"]),
    "a rate that changes": (slower_first(), {"max_gap_s": 100.0}, ["within a quarter of the usual"]),
    "slow": (at_rate(20.0, 2000), {}, ["25 to 20000 Hz are needed, so this log allows a rate of at most 80 Hz"]),
    "too slow": (at_rate(0.1, 2000), {}, [f"at 0.1 Hz; {UNIT}"]),
    "too fast": (at_rate(1e5, 2000), {}, [f"at 100000 Hz; {UNIT}"]),
    **{
        f"{n} samples": (stream(TIME[:n], VALUES[:n]), {}, [f"robot 2 has {n} samples; at least 16"])
        for n in (0, 1, 2, 15)
    },
    "repeats": (stream(np.append(TIME[:15], TIME[14]), VALUES[[*range(15), 14]]), {}, ["has 15 samples"]),
    "too short for the filter": (at_rate(1000.0, 300), {}, ["leaves 6 at 100 Hz; at least 16"]),
    "another epoch": (
        stream(TIME, VALUES, start_ns=10**18), {},
        ["robot 1 has 0.000 to 29.990 s and robot 2 has 1000000000.000 to 1000000029.990 s, no time in common; "
         "all stamps must come from one clock"],
    ),
    "stamps of all ages": (at_the_ends_of_the_range(), {}, ["leaps by 1.38350581e+10 s in row 100"]),
    "crowding": (crowding(), {}, ["20000 Hz are allowed"]),
}  # fmt: skip


@pytest.mark.parametrize("rows", [1, 700, 1024])
@pytest.mark.parametrize("fault", FAULTS)
def test_what_cannot_be_resampled(fault: str, rows: int) -> None:
    """Whatever the chunks, it is named with its row."""
    bad, options, words = FAULTS[fault]
    message = refusal(GOOD, bad, rows=rows, **options)
    for word in words:
        assert word in message


def test_a_longer_gap_may_be_allowed() -> None:
    assert resample(ArrayLog([without(range(500, 509))]), max_gap_s=0.09).reports[0].filled == 9


def test_uneven_stamps_are_no_loss():
    """125 Hz, a third of the period of jitter: one interval in nine is long, and as many are short."""
    time = np.sort(np.arange(6000) / 125.0 + 2.4e-3 * np.random.default_rng(2).standard_normal(6000))
    uneven = stream(time - time[0], tones(time, [1.0]))
    report = resample(ArrayLog([uneven]), 100.0).reports[0]
    assert report.filled > 660  # by intervals, more than a tenth


def test_the_recorders_time_is_suggested_where_it_helps():
    log_ns = GOOD.stamp_ns + 5
    one = Samples(GOOD.stamp_ns, VALUES, log_ns)
    for moved, is_hinted in ((0, True), (10**12, False)):
        far = Samples(GOOD.stamp_ns + 10**12, VALUES, log_ns + moved)
        assert ('clock = "log"' in refusal(one, far)) == is_hinted
    assert "log" not in refusal(GOOD, stream(TIME, VALUES, start_ns=10**18)).removeprefix("made.log")


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
