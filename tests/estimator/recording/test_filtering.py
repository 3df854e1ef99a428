import numpy as np
import pytest

from estimator.errors import InputError
from estimator.filtering import differentiate, low_pass, trim_slice

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


def test_low_pass_keeps_straight_lines_and_works_along_the_first_axis_only():
    lines = np.stack([np.full_like(TIME, 3.0), 0.5 * TIME - 2.0], axis=-1).reshape(-1, 1, 2)
    assert low_pass(lines, RATE, 5.0) == pytest.approx(lines, abs=1e-9)


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


def test_differentiate_of_degree_seven_is_not_exact():
    """The order claimed is the order had: degree 7 must show the h^6 error, 36 h^6 at the centre."""
    time = np.linspace(-1.0, 1.0, 41)
    error = differentiate(time**7, 20.0) - 7 * time**6
    assert error[20] == pytest.approx(36 * 0.05**6, rel=1e-6)


@pytest.mark.parametrize("frequency", [0.5, 3.0, 5.0, 20.0])
def test_differentiate_has_the_gain_of_the_six_point_stencil(frequency):
    phase = 2 * np.pi * frequency / RATE
    # 2 sum_k w_k sin(k x) with the textbook weights 45, -9, 1 over 60.
    gain = RATE * (45 * np.sin(phase) - 9 * np.sin(2 * phase) + np.sin(3 * phase)) / 30
    wave, quadrature = (f(2 * np.pi * frequency * TIME) for f in (np.sin, np.cos))
    assert differentiate(wave, RATE)[3:-3] == pytest.approx(gain * quadrature[3:-3], abs=1e-10 * gain)
    loss = 1 - gain / (2 * np.pi * frequency)
    assert loss == pytest.approx(phase**6 / 140, rel=0.5, abs=1e-12)


def test_differentiate_at_the_ends_follows_a_sine():
    wave = np.sin(2 * np.pi * 3.0 * TIME)
    exact = 2 * np.pi * 3.0 * np.cos(2 * np.pi * 3.0 * TIME)
    error = np.abs(differentiate(wave, RATE) - exact) / (2 * np.pi * 3.0)
    assert error.max() < 1e-5


def test_differentiate_works_along_the_first_axis_only():
    signals = np.stack([np.sin(TIME), np.cos(TIME)], axis=-1).reshape(-1, 2, 1)
    exact = np.stack([np.cos(TIME), -np.sin(TIME)], axis=-1).reshape(-1, 2, 1)
    assert differentiate(signals, RATE) == pytest.approx(exact, abs=1e-11)


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


def test_trim_drops_two_seconds_at_each_end():
    assert np.arange(1000)[trim_slice(1000, RATE, 2.0)].tolist() == list(range(200, 800))
    assert np.arange(1000)[trim_slice(1000, RATE, 0.0)].tolist() == list(range(1000))
    assert np.arange(401)[trim_slice(401, RATE, 2.0)].tolist() == [200]


def test_trim_refuses_what_leaves_nothing():
    with pytest.raises(
        InputError, match=r"400 samples are too few: dropping 2 s .* 100 Hz needs more than 400"
    ):
        trim_slice(400, RATE, 2.0)


@pytest.mark.parametrize("trim", [-0.1, np.nan, np.inf])
def test_trim_refuses_impossible_times(trim):
    with pytest.raises(InputError, match=r"trim_s is .*; it must be a finite number of seconds"):
        trim_slice(1000, RATE, trim)
