"""Many uneven samples: polynomials through the nearest of them, against numpy's and against closed forms."""

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from array_log import ArrayLog, stream, tones
from estimator.errors import InputError
from mocobot_logs.resample import resample
from mocobot_logs.resample_filter import Grid, Interpolator

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


def test_a_hole_is_still_refused(rng):
    time = poisson(rng)
    time = time[(time < 9.0) | (time > 9.2)]
    with pytest.raises(InputError, match=r"robot 1: no samples for 0\.2"):
        resample(ArrayLog([stream(time, tones(time, (1.0,)))]))
