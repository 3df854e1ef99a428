"""Stamps and channels of a log: rate, gaps, stuck and clipped channels, quantisation, noise; memory."""

from __future__ import annotations

import json
from typing import NamedTuple

import numpy as np
import pytest

from array_log import ArrayLog, stream
from estimator.quantisation import quantisation_step
from mocobot_inspect import survey as survey_module
from mocobot_inspect.channels import Channel, clipped, noise_level, oscillation, stuck
from mocobot_inspect.findings import findings
from mocobot_inspect.report import format_inspection, inspection_dict
from mocobot_inspect.survey import Survey, survey
from mocobot_inspect.team import clean_stream, inspect_log, stretches
from mocobot_logs.log import CHANNELS, Level, Samples
from omnid_design import DESIGN

RATE = 100.0


def motion(seconds: float, rate_hz: float = RATE, seed: int = 0, noise: float = 1e-4) -> np.ndarray:
    """Nine channels of an arm that moves: slow sines and a little noise, shape (q, 9)."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(seconds * rate_hz)) / rate_hz
    phase, frequency = rng.uniform(0, 6, 9), rng.uniform(0.2, 0.5, 9)
    wave = np.sin(2 * np.pi * frequency * time[:, None] + phase)
    return 0.3 * wave + noise * rng.standard_normal(wave.shape)


def regular(values: np.ndarray, rate_hz: float = RATE, start_ns: int = 0) -> Samples:
    return stream(np.arange(len(values)) / rate_hz, values, start_ns)


def channel(found: Survey, robot: int, name: str) -> Channel:
    return found.channels[robot][CHANNELS["joint"].index(name)]


# Stamps


@pytest.mark.parametrize("rows", [7, 1000, 100_000])
def test_stamps_are_counted_whatever_the_chunks(rows: int) -> None:
    time = np.arange(6000) / RATE
    keep = np.ones(len(time), bool)
    keep[1000:1004] = keep[3000:3100] = keep[5000] = False
    time = time[keep]
    time = np.concatenate([time[:20], time[19:20], time[20:]])  # a stamp twice
    values = np.zeros((len(time), 9))
    log = ArrayLog([stream(time, values, start_ns=10**18)], rows)
    t = survey(log).timing[0]
    assert (t.samples, t.duplicates, t.backwards) == (6000 - 105 + 1, 1, 0)
    assert (t.gaps, t.missing) == (3, 105)
    assert t.rate_hz == pytest.approx(RATE, rel=1e-9)
    assert t.longest_gap_s == pytest.approx(1.01, abs=1e-9)
    assert t.longest_gap_at_s == pytest.approx(29.99, abs=1e-9)
    assert t.duration_s == pytest.approx(59.99, abs=1e-9)
    assert t.jitter_max_s < 1e-8


def test_jitter_is_recovered() -> None:
    rng = np.random.default_rng(1)
    time = np.arange(20_000) / RATE + rng.normal(0, 5e-4, 20_000)
    t = survey(ArrayLog([stream(time, np.zeros((20_000, 9)))])).timing[0]
    # The difference of two independent stamps.
    assert t.jitter_rms_s == pytest.approx(np.sqrt(2) * 5e-4, rel=0.03)
    assert t.rate_hz == pytest.approx(RATE, rel=1e-3)
    assert (t.gaps, t.duplicates, t.backwards) == (0, 0, 0)


def test_time_that_runs_backwards_and_a_recorder_that_hangs() -> None:
    time = np.arange(3000) / RATE
    log_ns = np.rint((time + 0.002) * 1e9).astype(np.int64)
    log_ns[2000:] += 3_000_000_000
    time[1500:] -= 2.0
    samples = stream(time, np.zeros((3000, 9)), log_ns=log_ns)
    t = survey(ArrayLog([samples])).timing[0]
    assert t.backwards == 1
    assert (t.farthest_back_s, t.farthest_back_at_s) == pytest.approx((1.99, 14.99))
    assert t.recorder_s == pytest.approx((0.002, 5.002))


# Channels


def test_values_that_are_not_finite_are_counted() -> None:
    values = motion(60.0)
    values[100:140, 4] = np.nan
    values[7, 8] = np.inf
    found = survey(ArrayLog([regular(values)], rows=333))
    c = channel(found, 0, "theta_y")
    assert (c.nans, c.infinities) == (40, 0)
    assert c.highest == pytest.approx(np.nanmax(values[:, 4]))
    assert channel(found, 0, "tau3").infinities == 1
    assert np.isfinite(channel(found, 0, "tau3").highest)


@pytest.mark.parametrize("bits", [10, 12, 16, 20])
def test_the_quantisation_step_is_recovered(bits: int) -> None:
    step, offset = 2 * np.pi / 2**bits, 0.1234
    smooth = motion(60.0, noise=0.0)[:, 0]
    values = np.round((smooth - offset) / step) * step + offset
    assert quantisation_step(values) == pytest.approx(step, rel=1e-6)
    # In degrees, with the other sign, as a 32-bit float.
    assert quantisation_step(-np.rad2deg(values)) == pytest.approx(np.rad2deg(step), rel=1e-6)
    assert quantisation_step(smooth) is None
    assert quantisation_step(np.random.default_rng(bits).standard_normal(5000)) is None
    assert quantisation_step(np.array([0.0, 1.0, 2.0])) is None


@pytest.mark.parametrize("sigma", [1e-4, 3e-3])
def test_the_noise_is_recovered_on_top_of_motion(sigma: float) -> None:
    assert noise_level(motion(60.0, noise=sigma)[:, 2]) == pytest.approx(sigma, rel=0.06)


# Stuck and clipped


class Run(NamedTuple):
    """Rows in which a channel stands."""

    kind: str
    channel: int
    start: int
    stop: int
    value: float


def frozen(values: np.ndarray, rate_hz: float) -> list[Run]:
    runs = [("stuck", run) for run in stuck(values, rate_hz)] + [("clipped", run) for run in clipped(values)]
    return [Run(kind, k, start, stop, values[start, k]) for kind, (k, start, stop, _) in runs]


@pytest.mark.parametrize("step", [0.0, 1e-4, 3e-3])
@pytest.mark.parametrize("start", [0, 1237, 2900])
def test_a_stuck_second_is_found(step: float, start: int) -> None:
    values = motion(30.0, noise=0.0 if step else 1e-5)
    values = np.round(values / step) * step if step else values
    values[start : start + 100, 4] = values[start, 4]
    found = [f for f in frozen(values, RATE) if f.kind == "stuck"]
    assert [(f.channel, f.start) for f in found] == [(4, pytest.approx(start, abs=10))]
    assert found[0].stop - found[0].start == pytest.approx(100, abs=20)


def comes_to_rest() -> np.ndarray:
    """A minute of motion that slows down and rests from its 40th second on."""
    values = motion(60.0, noise=0.0)
    blend = np.clip((np.arange(6000) - 2000) / 500, 0, 1)[:, None]
    values = values * (1 - blend) + values[2000] * blend
    values[4000:] = values[4000]
    return values


def test_rest_is_not_stuck() -> None:
    """Everything stands for a while, as in a static trial; encoders do not even flicker."""
    values = comes_to_rest()
    assert frozen(np.round(values / 1e-4) * 1e-4, RATE) == []
    exact = motion(60.0, noise=0.0)  # sensors without noise and steps
    exact[5000:] = exact[5000]
    assert frozen(exact, RATE) == []


def test_a_channel_that_is_not_moved_is_not_stuck() -> None:
    """One gimbal axis is left alone for a while and then moved gently; the others go on."""
    values = motion(60.0, noise=0.0)
    time = np.arange(6000) / RATE
    share = np.clip((time - 20) / 20, 0, 1)
    values[:, 3] = 0.1 * share**3 * (10 - 15 * share + 6 * share**2)  # minimum jerk
    assert frozen(np.round(values / 1e-4) * 1e-4, RATE) == []


def test_a_clipped_channel() -> None:
    values = motion(30.0, noise=0.0)
    values[:, 6] = np.minimum(values[:, 6], 0.2)
    found = frozen(values, RATE)
    assert {(f.kind, f.channel, f.value) for f in found if f.kind == "clipped"} == {("clipped", 6, 0.2)}
    assert len([f for f in found if f.kind == "clipped"]) >= 6  # peaks of a sine of 0.2 to 0.5 Hz in 30 s


def test_round_peaks_are_not_clipped() -> None:
    values = np.round(motion(60.0, noise=0.0) / 2e-3) * 2e-3
    assert [f for f in frozen(values, RATE) if f.kind == "clipped"] == []


# Excerpts


def test_a_long_log_is_looked_at_where_it_is_lively(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(survey_module, "EXCERPT_S", 60.0)
    quiet = np.zeros((60_000, 9))
    quiet[30_000:36_000] = motion(60.0)
    log = ArrayLog([regular(quiet), regular(quiet, start_ns=500_000_000)])
    found = survey(log)
    assert log.reads == 2
    assert found.excerpt_s == pytest.approx((300.0, 360.0), abs=10.0)
    assert all(len(samples.stamp_ns) <= 7000 for samples in found.excerpt)
    assert found.timing[0].samples == 60_000
    short = ArrayLog([regular(quiet[:5000])])
    assert survey(short).excerpt_s is None
    assert short.reads == 1


def test_stretches_are_what_all_robots_have() -> None:
    a, b = motion(30.0, seed=1), motion(30.0, seed=2)
    b[1000] = np.nan  # one row less is no gap
    gap = np.ones(3000, bool)
    gap[2000:2050] = False
    time = np.arange(3000) / RATE
    streams = [clean_stream(stream(time, a), 0), clean_stream(stream(time[gap], b[gap]), 0)]
    found = stretches(streams)
    assert [start for start, _ in found] == pytest.approx([0.0, 20.5])
    assert [len(part) for _, part in found] == [2000, 950]
    # On the grid, samples stay what they are; the missing row is interpolated.
    assert np.abs(found[0][1][:, 0] - a[:2000]).max() < 1e-12
    assert np.abs(found[0][1][:, 1] - b[:2000])[np.arange(2000) != 1000].max() < 1e-12
    assert found[0][1][1000, 1] == pytest.approx((b[999] + b[1001]) / 2, abs=2e-3)


@pytest.mark.parametrize(
    "spoil",
    [
        lambda x: x * 1e300,
        lambda x: x * 1e-300,
        lambda x: np.full_like(x, np.nan),
        lambda x: np.zeros_like(x),
        lambda x: np.where(np.arange(len(x))[:, None] % 2, 1e308, -1e308) * np.ones_like(x),
        lambda x: x[:3],
        lambda x: x[:0],
        lambda x: x[:, ::-1],
    ],
    ids=["huge", "tiny", "NaN", "zero", "flicker", "three rows", "none", "reversed"],
)
@pytest.mark.parametrize("rate_hz", [100.0, 5000.0])
@pytest.mark.parametrize("level", ["joint", "wrist"])
def test_absurd_logs_are_reported(spoil, rate_hz: float, level: Level) -> None:
    """Warnings are errors here; no number may do harm."""
    whole = motion(5.0, rate_hz)
    spoiled = spoil(motion(5.0, rate_hz, seed=1))
    log = ArrayLog([regular(whole, rate_hz), regular(spoiled, rate_hz)], level=level)
    found = inspect_log(log, DESIGN)
    assert format_inspection(found).splitlines()[-1].startswith("ready for: nothing")
    json.dumps(inspection_dict(found), allow_nan=False)


def test_a_slow_joint_with_a_coarse_encoder_is_neither_stuck_nor_clipped() -> None:
    """It stays on a step for a second, and on the highest and lowest one for longer, while others move."""
    values = motion(60.0, noise=0.0)
    time = np.arange(6000) / RATE
    values[:, 3] = np.round(0.3 * np.sin(2 * np.pi * 0.05 * time) / 0.05) * 0.05
    assert np.mean(np.diff(values[:, 3]) == 0) > 0.98
    assert frozen(values, RATE) == []


# Oscillations

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
