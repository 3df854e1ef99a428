"""Resampling against closed forms, and against the same done on the whole signal at once."""

from __future__ import annotations

import tracemalloc
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import make_interp_spline
from scipy.signal import firwin

from array_log import ArrayLog, stream, tones
from mocobot_logs.log import Samples
from mocobot_logs.resample import Resampled, resample
from mocobot_logs.resample_filter import low_pass_taps

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


def test_samples_beside_the_grid_are_not():
    time = np.arange(3000) / 100.0
    time[1::2] += 1.6e-6
    report = one_robot(time, tones(time, BAND_HZ)).reports[0]
    assert report.method == "interpolated"
    # Intervals are 10 ms +- 1.6 us, of median 10 ms + 1.6 us or - 1.6 us.
    assert report.jitter_max_s == pytest.approx(3.2e-6, abs=1e-9)


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


@pytest.mark.parametrize(("rate_hz", "at_ends"), [(25.0, 5e-2), (30.0, 2e-2), (50.0, 1e-5), (100.2, 1e-5)])
def test_five_hertz_of_slow_logs(rate_hz, at_ends):
    """Loss and images are those of the cardinal quintic spline: sinc^6 over the sum of its copies."""
    time = np.arange(round(20 * rate_hz)) / rate_hz
    result = one_robot(time, tones(time, [5.0]))
    copies = np.sinc(5.0 / rate_hz + np.arange(-20, 21)) ** 6
    loss = 1.0 - copies[20] / copies.sum()
    error = np.abs(result.values[0] - tones(grid_s(result), [5.0]))
    assert error[200:-200].max() < 2.0 * loss + 5e-6
    assert error.max() < at_ends


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


def test_a_thinned_log_without_the_filter_would_fold():
    """The measure above sees a fold where there is one."""
    time = np.arange(8000) / 1000.0
    tone = np.sin(2 * np.pi * 103.0 * time)[:, None]
    assert low_band_amplitude(tone[::10]) > 0.9
    assert low_band_amplitude(one_robot(time, tone).values[0]) < 1e-5


def test_dropped_samples_at_1_khz():
    time = jittered(1000.0, 10.0, 0.1, drop=0.02)
    result = one_robot(time, tones(time, BAND_HZ))
    np.testing.assert_allclose(result.values[0], tones(grid_s(result), BAND_HZ), rtol=0, atol=1e-5)
    report = result.reports[0]
    assert report.filled == 200
    assert report.native_hz == pytest.approx(1000.0, abs=0.05)
    assert report.jitter_rms_s == pytest.approx(1e-4 * np.sqrt(2 / 3), rel=0.05)  # difference of two uniforms


# --- blocks and chunks


@pytest.mark.parametrize(("rate_hz", "k", "jitter"), [(130.0, 4, 0.2), (1000.0, 10, 0.1)])
def test_blocks_make_the_same_as_the_whole_signal(rate_hz, k, jitter):
    """Against one spline through all rows and one convolution."""
    rng = np.random.default_rng(2)
    time = jittered(rate_hz, 13000 / rate_hz, jitter)
    values = rng.normal(size=(len(time), 9))
    result = one_robot(time, values)
    stamps = np.rint(time * 1e9) * 1e-9
    fine = make_interp_spline(stamps, values, k=5)(np.arange(int(stamps[-1] * 100.0 * k) + 1) / (100.0 * k))
    taps = firwin(24 * k + 1, 35.0, window=("kaiser", 0.1102 * (110 - 8.7)), fs=100.0 * k)
    expected = np.stack([np.convolve(x, taps, "valid")[::k] for x in fine.T], axis=1)
    np.testing.assert_allclose(result.values[0], expected, rtol=0, atol=1e-11)
    assert result.start_s[0] == pytest.approx(0.12)


def test_the_last_sample_is_the_last_instant():
    time = np.arange(400) / 25.0
    result = one_robot(time, tones(time, [1.0]))
    assert grid_s(result)[-1] == pytest.approx(time[-1])
    np.testing.assert_allclose(result.values[0][-1], tones(time[-1:], [1.0])[0], rtol=0, atol=1e-9)


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


def test_rows_one_by_one():
    whole = made_stream("interpolated")
    expected, result = resample(ArrayLog([whole], 10**6)), resample(ArrayLog([whole], 1))
    np.testing.assert_array_equal(result.values[0], expected.values[0])


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


def test_crowding_samples_do_not_make_noise_large():
    """A late callback and one in time, 50 us apart: the noise of the result stays that of the samples."""
    rng = np.random.default_rng(4)
    time = np.arange(4000) / 100.0 + np.append(0.0, rng.uniform(-1e-4, 1e-4, 3999))
    time[50::100] = time[51::100] - 50e-6
    result = one_robot(time, rng.normal(size=(4000, 9)))
    assert (result.reports[0].merged, result.reports[0].filled) == (40, 40)
    assert np.abs(result.values[0]).max() < 5.0


def test_a_stream_that_leaves_the_grid_is_read_again():
    time = np.arange(9000) / 100.0
    time[5000:] += 3e-5 * np.arange(4000) / 100.0  # a clock that is adjusted
    log = ArrayLog([stream(np.arange(9000) / 100.0, tones(time, [1.0])), stream(time, tones(time, [1.0]))])
    progress = []
    result = resample(log, advance=progress.append)
    assert (log.reads, sum(progress)) == (2, log.size)
    assert [report.method for report in result.reports] == ["untouched", "interpolated"]
    np.testing.assert_array_equal(result.values[0], log.streams[0].values)
    np.testing.assert_allclose(result.values[1], tones(grid_s(result, 1), [1.0]), rtol=0, atol=1e-5)


def test_robots_keep_their_own_grids():
    time = np.arange(3000) / 100.0
    log = ArrayLog(
        [stream(time, tones(time, [1.0]), EPOCH_NS + 5_003_000), stream(time, tones(time, [1.0]), EPOCH_NS)]
    )
    result = resample(log)
    assert result.origin_ns == EPOCH_NS
    np.testing.assert_allclose(result.start_s, [0.005003, 0.0], rtol=0, atol=1e-12)


def test_progress_counts_every_row_once():
    seen = []
    log = ArrayLog([made_stream("untouched"), made_stream("interpolated")], 100)
    resample(log, advance=seen.append)
    assert sum(seen) == log.size


def test_only_the_result_is_kept():
    """Twice the log takes more memory by no more than what comes out, and a little."""

    class Endless(ArrayLog):
        def chunks(self, advance):
            rng = np.random.default_rng(5)
            for block in range(self.rows):
                stamp = 1_000_000 * np.arange(1000 * block, 1000 * (block + 1)) + rng.integers(
                    -9e4, 9e4, 1000
                )
                yield 0, Samples(np.maximum(stamp, 0), rng.normal(size=(1000, 9)))

    def peak(seconds: int) -> int:
        tracemalloc.start()
        resample(Endless([made_stream("untouched")], seconds))
        size = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return size

    short, long = peak(20), peak(80)
    result_bytes, log_bytes = (rate * 60 * 9 * 8 for rate in (100, 1000))
    assert long - short < 2.5 * result_bytes < 0.3 * log_bytes


@pytest.mark.parametrize("k", [2, 3, 7, 10, 30])
def test_low_pass_is_what_it_says(k):
    taps = low_pass_taps(k)
    frequency = np.linspace(0.0, k / 2, 1000 * k + 1)[:5000]  # in output rates
    time = np.arange(len(taps)) - len(taps) // 2
    gain = np.cos(2 * np.pi * np.multiply.outer(frequency, time / k)) @ taps  # symmetric: real
    np.testing.assert_array_equal(taps, taps[::-1])
    assert np.abs(gain[frequency <= 0.2] - 1.0).max() < 5e-6
    assert np.abs(gain[frequency >= 0.5]).max() < 10 ** (-108 / 20)
