"""A channel that oscillates faster than its robot moves, against sines of known size; and what is no line."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import butter, sosfilt

from array_log import ArrayLog, stream
from mocobot_inspect.channels import Oscillation, joined, oscillation
from mocobot_inspect.findings import findings
from mocobot_inspect.report import inspection_dict
from mocobot_inspect.team import inspect_log
from omnid_design import DESIGN

RATE = 100.0
TIME = np.arange(3000) / RATE


def read(
    extra: np.ndarray | float = 0.0, step: float = 0.01, sigma: float = 0.01, seed: int = 0
) -> np.ndarray:
    """A torque sensor on a slow motion of 3 N m."""
    rng = np.random.default_rng(seed)
    smooth = 4.0 + 3.0 * np.sin(2 * np.pi * 0.4 * TIME + 1.0) + extra
    noisy = smooth + sigma * rng.standard_normal(len(TIME))
    return np.round(noisy / step) * step


def sine(hz: float, amplitude: float) -> np.ndarray:
    return amplitude * np.sin(2 * np.pi * hz * TIME + 0.3)


@pytest.mark.parametrize("hz", [12.0, 29.7, 43.0])
@pytest.mark.parametrize("amplitude", [0.3, 5.0])
def test_frequency_and_amplitude(hz: float, amplitude: float) -> None:
    found = oscillation(read(sine(hz, amplitude)), RATE)
    assert found is not None
    assert found.frequency_hz == pytest.approx(hz, abs=0.25)
    assert found.amplitude == pytest.approx(amplitude, rel=0.03)
    assert found.duration_s == pytest.approx(30.0)


def test_what_is_faster_than_half_the_rate_is_folded() -> None:
    found = oscillation(read(sine(70.3, 2.0)), RATE)
    assert found is not None
    assert found.frequency_hz == pytest.approx(29.7, abs=0.25)


def test_a_part_of_the_trial() -> None:
    found = oscillation(read(sine(30.0, 1.0) * (TIME > 20.0)), RATE)
    assert found is not None
    assert found.duration_s == pytest.approx(10.0)


@pytest.mark.parametrize(
    "extra",
    [
        0.0,
        sine(30.0, 0.03),  # a small hum: three times the noise
        sine(3.0, 2.0),  # an arm that shakes
        2.0 * np.exp(-np.square((TIME - 15.0) / 0.02)),  # a bump
        np.where(TIME > 12.0, 2.0, 0.0),
    ],
    ids=["nothing", "hum", "shaking", "bump", "step"],
)
def test_no_line(extra: np.ndarray | float) -> None:
    assert oscillation(read(extra), RATE) is None


def test_a_hum_of_five_times_the_noise_of_a_fine_sensor() -> None:
    assert oscillation(read(sine(30.0, 0.05), step=1e-6), RATE) is None
    assert oscillation(read(sine(30.0, 0.2), step=1e-6), RATE) is not None


def test_shaking_over_many_frequencies_is_no_line() -> None:
    band = butter(12, (13.0, 24.0), btype="band", fs=RATE, output="sos")
    shaking = sosfilt(band, np.random.default_rng(8).standard_normal(len(TIME)))
    assert oscillation(read(3.0 * shaking), RATE) is None


@pytest.mark.parametrize("rate", [0.02, 0.03, 0.07])
def test_stairs_of_a_slow_encoder_are_no_line(rate: float) -> None:
    """A joint that creeps evenly: its steps come at 10 Hz and more."""
    step = 1.5e-3
    assert oscillation(np.round(rate * TIME / step) * step, RATE) is None


@pytest.mark.parametrize(("size", "rate_hz"), [(0, RATE), (249, RATE), (3000, 39.0)])
def test_too_short_and_too_slow(size: int, rate_hz: float) -> None:
    assert oscillation(read(sine(12.0, 5.0))[:size], rate_hz) is None


def test_a_fast_log_is_looked_at_in_shorter_windows() -> None:
    """Rows come 20,000 at a time: two seconds of 10 kHz."""
    time = np.arange(20_000) / 10_000.0
    hum = 0.5 * np.sin(2 * np.pi * 50.0 * time) + 0.01 * np.random.default_rng(2).standard_normal(len(time))
    found = oscillation(hum, 10_000.0)
    assert found is not None
    assert found.frequency_hz == pytest.approx(50.0, abs=0.5)
    assert found.amplitude == pytest.approx(0.5, rel=0.02)
    assert found.duration_s == pytest.approx(2.0)


def test_parts_are_joined() -> None:
    assert joined([]) is None
    parts = [Oscillation(30.0, 1.0, 2.5), Oscillation(29.0, 4.0, 5.0)]
    assert joined(parts) == Oscillation(29.0, 4.0, 7.5)


def log(lines: dict[tuple[int, int], np.ndarray]) -> ArrayLog:
    rng = np.random.default_rng(3)
    robots = []
    for robot in (1, 2):
        slow = 0.3 * np.sin(2 * np.pi * rng.uniform(0.2, 0.5, 9) * TIME[:, None] + rng.uniform(0, 6, 9))
        values = slow + 1e-4 * rng.standard_normal(slow.shape)
        for (of, column), line in lines.items():
            if of == robot:
                values[:, column] += line
        robots.append(stream(TIME, values))
    return ArrayLog(robots)


def test_the_torque_that_oscillates_most_is_said_with_what_shakes_along() -> None:
    found = inspect_log(
        log({(2, 7): sine(29.6, 0.5), (2, 6): sine(29.6, 0.1), (1, 1): sine(29.6, 0.7)}), DESIGN
    )
    said = [f.sentence for f in findings(found) if "oscillates" in f.sentence]
    assert said == [
        "omnid2.tau2 oscillates at 29.6 Hz, or what folds to that, by up to +-0.5 N m for 30 s, and omnid2.tau1 and "
        "omnid1.phi2 with it: is a control loop unstable?"
    ]
    told = inspection_dict(found)["channels"]
    assert told[1]["tau2"]["oscillation"]["amplitude"] == pytest.approx(0.5, rel=0.02)
    assert told[0]["tau2"]["oscillation"] is None


def test_silence_without_any() -> None:
    assert not [f for f in findings(inspect_log(log({}), DESIGN)) if "oscillates" in f.sentence]
