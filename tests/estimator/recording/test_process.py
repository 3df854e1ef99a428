"""Filters, derivatives, and the data points made of a recording."""

import dataclasses

import numpy as np
import pytest

from estimator import signals as process
from estimator.errors import InputError
from estimator.filtering import differentiate, low_pass
from estimator.signals import process_recording
from recorded_team import INERTIA, Sines, carry, inertia_by_least_squares
from recordings import metadata, small_recording

RATE = 100.0
TIME = np.arange(3000) / RATE
INSIDE = slice(500, -500)


@pytest.mark.parametrize("frequency", [0.2, 1.0, 3.0, 5.0, 9.0, 30.0])
@pytest.mark.parametrize("cutoff", [2.0, 5.0, 20.0])
def test_low_pass_has_zero_phase_and_the_squared_butterworth_gain(frequency, cutoff):
    # Third-order prototype 1 / (1 + w^6), bilinear transform with the cut-off prewarped, run twice.
    gain = 1.0 / (1.0 + (np.tan(np.pi * frequency / RATE) / np.tan(np.pi * cutoff / RATE)) ** 6)
    wave = np.sin(2 * np.pi * frequency * TIME + 0.3)
    assert low_pass(wave, RATE, cutoff)[INSIDE] == pytest.approx(gain * wave[INSIDE], abs=1e-9)


def test_low_pass_settles_within_the_default_trim():
    """A step at the start that is not there must be forgotten after the two seconds that are dropped."""
    wave = np.sin(2 * np.pi * 0.7 * TIME + 0.9)
    longer = np.sin(2 * np.pi * 0.7 * (np.arange(-2000, 5000) / RATE) + 0.9)
    assert low_pass(wave, RATE, 5.0)[200:-200] == pytest.approx(
        low_pass(longer, RATE, 5.0)[2200:-2200], abs=1e-12
    )


@pytest.mark.parametrize("cutoff", [0.0, -1.0, 50.0, np.nan, np.inf])
def test_low_pass_refuses_impossible_cutoffs(cutoff):
    with pytest.raises(InputError, match=r"cutoff_hz is .* between 0 and 50 Hz"):
        low_pass(TIME, RATE, cutoff)


@pytest.mark.parametrize("degree", range(7))
def test_differentiate_is_exact_for_polynomials_of_degree_six_also_at_the_ends(degree):
    time = np.linspace(-1.0, 1.0, 41)
    rate = 20.0
    exact = degree * time ** max(degree - 1, 0)
    assert differentiate(time**degree, rate) == pytest.approx(exact, abs=1e-11)


@pytest.mark.parametrize("frequency", [0.5, 3.0, 5.0, 20.0])
def test_differentiate_has_the_gain_of_the_six_point_stencil(frequency):
    phase = 2 * np.pi * frequency / RATE
    # 2 sum_k w_k sin(k x) with the textbook weights 45, -9, 1 over 60.
    gain = RATE * (45 * np.sin(phase) - 9 * np.sin(2 * phase) + np.sin(3 * phase)) / 30
    wave, quadrature = (f(2 * np.pi * frequency * TIME) for f in (np.sin, np.cos))
    assert differentiate(wave, RATE)[3:-3] == pytest.approx(gain * quadrature[3:-3], abs=1e-10 * gain)
    loss = 1 - gain / (2 * np.pi * frequency)
    assert loss == pytest.approx(phase**6 / 140, rel=0.5, abs=1e-12)


@pytest.mark.parametrize("rows", [0, 1, 15])
@pytest.mark.parametrize(
    "function",
    [lambda x: low_pass(x, RATE, 5.0), lambda x: differentiate(x, RATE)],
    ids=["low_pass", "differentiate"],
)
def test_too_few_samples_are_refused_and_the_least_number_works(function, rows):
    with pytest.raises(InputError, match=rf"^{rows} samples are too few; at least 16"):
        function(np.zeros((rows, 3)))
    assert function(np.ones((16, 3))).shape == (16, 3)


PERIODIC = [*np.deg2rad([3.5, 3.5, 3.5]), 0.01, 0.01, 0.01]
RANDOM = [*np.deg2rad([3.0, 3.0, 1.5]), 0.015, 0.015, 0.015]


def carried(kind, seed, duration_s=60.0):
    rng = np.random.default_rng(seed)
    squeeze = Sines.draw(rng, [5.0] * 3, 8, 0.1, 1.5)
    if kind == "periodic":
        return carry(Sines.draw(rng, PERIODIC, 3, 0.3, 0.7), squeeze, duration_s)
    return carry(Sines.draw(rng, RANDOM, 20, 0.1, 1.5), squeeze, duration_s)


def rms(error, reference):
    return np.sqrt(np.mean(error**2) / np.mean(reference**2))


@pytest.fixture(scope="module")
def fast():
    """Motion with content up to 3 Hz."""
    rng = np.random.default_rng(4)
    path = Sines.draw(rng, [*np.deg2rad([2.0, 2.0, 1.0]), 0.01, 0.01, 0.01], 20, 0.2, 3.0)
    return carry(path, Sines.draw(rng, [5.0] * 3, 8, 0.1, 3.0), 20.0)


def test_data_points_are_the_truth_where_the_filter_is_transparent(fast):
    """Cut-off 40 Hz, motion up to 3 Hz: what is left is the error of the method itself."""
    data, keep = process_recording(fast.recording, cutoff_hz=40.0), slice(200, -200)
    assert np.array_equal(data.time, fast.recording.time[keep])
    assert rms(data.twist - fast.twist[keep], fast.twist) < 1e-6
    for part in (slice(0, 3), slice(3, 6)):
        assert rms((data.twist_dot - fast.twist_dot[keep])[..., part], fast.twist_dot[..., part]) < 1e-5
    assert rms((data.wrench - fast.wrench[keep])[..., 3:], fast.wrench[..., 3:]) < 1e-6
    assert rms((data.wrench - fast.wrench[keep])[..., :3], fast.wrench[..., :3]) < 1e-5
    assert np.abs(fast.wrench[..., :3]).max() > 1e-4


def test_blocks_and_robots_do_not_show_in_the_result(fast, monkeypatch):
    """Bit for bit: the whole trial at once, in small blocks, and every robot alone."""
    fields = ("time", "R_bi", "p_bi", "twist", "twist_dot", "wrench")
    monkeypatch.setattr(process, "BLOCK", 10**9)
    whole = process_recording(fast.recording)
    for block in (1, 7, 1000):
        monkeypatch.setattr(process, "BLOCK", block)
        split = process_recording(fast.recording)
        for field in fields:
            assert np.array_equal(getattr(split, field), getattr(whole, field)), (block, field)
    recording = fast.recording
    for robot in range(3):
        parts = {name: getattr(recording, name)[:, [robot]] for name in ("phi", "theta", "tau")}
        alone = process_recording(dataclasses.replace(recording, metadata=metadata(robots=1), **parts))
        for field in fields[1:]:
            assert np.array_equal(getattr(alone, field)[:, 0], getattr(whole, field)[:, robot]), field


@pytest.mark.parametrize("seed", range(3))
def test_inertia_bias_of_periodic_motion(seed):
    """The target is 0.02 %; a two-point difference alone would cost 0.1 %."""
    trial = carried("periodic", seed)
    estimate = inertia_by_least_squares(process_recording(trial.recording))
    assert np.linalg.norm(estimate - INERTIA) / np.linalg.norm(INERTIA) < 1e-5


@pytest.mark.parametrize("seed", range(3))
def test_inertia_bias_of_random_motion(seed):
    """Filtered signals obey the nonlinear equations of motion only nearly: part of the method."""
    trial = carried("random", seed)
    estimate = inertia_by_least_squares(process_recording(trial.recording))
    assert np.linalg.norm(estimate - INERTIA) / np.linalg.norm(INERTIA) < 1e-3


def test_bad_input_is_refused_with_the_recordings_name():
    good = dataclasses.replace(small_recording(rows=401), name="trial.parquet")
    assert process_recording(good).samples == 1
    with pytest.raises(InputError, match=r"^trial.parquet: 401 samples are too few"):
        process_recording(good, trim_s=3.0)
    with pytest.raises(InputError, match=r"^cutoff_hz is 60.0"):
        process_recording(good, cutoff_hz=60.0)
    phi = good.phi.copy()
    phi[3, 0, 0] = np.nan
    with pytest.raises(InputError, match=r"^trial.parquet: column 'omnid1.phi1' is nan"):
        process_recording(dataclasses.replace(good, phi=phi))
