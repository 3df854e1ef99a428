"""From which number on something is worth a word, and what is then said: surveys made by hand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from array_log import ArrayLog, stream
from estimator.clocks import ClockEstimate
from mocobot_inspect.channels import Stretch
from mocobot_inspect.findings import findings
from mocobot_inspect.report import format_inspection, verdict
from mocobot_inspect.team import Inspection, Readiness, Segments, inspect_log
from omnid_design import DESIGN

S = 1_000_000_000
TIME = np.arange(600) / 100.0


@pytest.fixture(scope="module")
def plain() -> Inspection:
    """Three robots with nothing to be said of."""
    rng = np.random.default_rng(3)
    waves = 0.1 * np.sin(2 * np.pi * np.multiply.outer(TIME, rng.uniform(0.2, 0.4, 9)) + rng.uniform(0, 6, 9))
    waves[:, 6:] *= 20.0
    waves[:, :3] -= 0.3
    streams = [stream(TIME, waves + 1e-4 * rng.standard_normal(waves.shape)) for _ in range(3)]
    found = inspect_log(ArrayLog(streams), DESIGN)
    return replace(found, clocks=None, skewed=False, wiring=None, ready=None, ready_undone=None)


def told(found: Inspection, topic: str) -> list[str]:
    return [one.sentence for one in findings(found) if one.topic == topic]


def timed(found: Inspection, *changes: Mapping[str, Any]) -> Inspection:
    """With other stamps of the first robots."""
    timing = [replace(t, **change) for t, change in zip(found.survey.timing, changes, strict=False)]
    rest = found.survey.timing[len(timing) :]
    return replace(found, survey=replace(found.survey, timing=(*timing, *rest)))


def with_channel(found: Inspection, robot: int, name: str, **change: Any) -> Inspection:
    channels = [list(of) for of in found.survey.channels]
    k = found.channel_names.index(name)
    channels[robot][k] = replace(channels[robot][k], **change)
    return replace(found, survey=replace(found.survey, channels=tuple(map(tuple, channels))))


def test_nothing_is_said_of_a_plain_log(plain: Inspection) -> None:
    assert findings(plain) == []
    assert "[[Wrong]]  nothing found" in format_inspection(plain)


# Stamps


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"rate_hz": 10.0}, []),
        ({"rate_hz": 9.9, "jitter_rms_s": 0.0}, ["samples come at 9.9 Hz, which is no robot's rate"]),
        ({"rate_hz": 20_000.0}, []),
        (
            {"rate_hz": 20_100.0},
            ["samples come at 2.01e+04 Hz: is its time in seconds, taken for milliseconds?"],
        ),
        ({"rate_hz": 0.1}, ["samples come at 0.1 Hz: is its time in milliseconds, taken for seconds?"]),
        ({"rate_hz": 4.9}, ["samples come at 4.9 Hz: is its time in milliseconds, taken for seconds?"]),
        ({"rate_hz": 5.1}, ["samples come at 5.1 Hz, which is no robot's rate"]),
        ({"rate_hz": 0.004}, ["samples come at 0.004 Hz: is its time in microseconds, taken for seconds?"]),
        ({"rate_hz": 1e-7}, ["samples come at 1e-07 Hz: is its time in nanoseconds, taken for seconds?"]),
        ({"rate_hz": 1e5}, ["samples come at 1e+05 Hz: is its time in seconds, taken for milliseconds?"]),
        ({"rate_hz": 1e8}, ["samples come at 1e+08 Hz: is its time in seconds, taken for microseconds?"]),
        ({"rate_hz": None}, ["600 samples are too few"]),
        (
            {"gaps": 2, "missing": 200, "longest_gap_s": 1.5, "longest_gap_at_s": 2.25},
            ["200 samples (25 %) are missing in 2 gaps, the longest of 1.5 s from 2.25 s on"],
        ),
        (
            {"gaps": 1, "missing": 6},
            ["6 samples (0.99 %) are missing in 1 gap, the longest of 0 s from 0.00 s on"],
        ),
        ({"duplicates": 1}, ["a stamp is repeated 1 time"]),
        ({"duplicates": 3}, ["a stamp is repeated 3 times"]),
        (
            {"backwards": 1, "farthest_back_s": 0.5, "farthest_back_at_s": 3.0},
            ["time runs backwards 1 time by 0.5 s after 3.00 s"],
        ),
        (
            {"backwards": 2, "farthest_back_s": 0.5, "farthest_back_at_s": 3.0},
            ["time runs backwards 2 times, at most by 0.5 s after 3.00 s"],
        ),
        ({"jitter_rms_s": 0.0019}, []),
        (
            {"jitter_rms_s": 0.0021, "jitter_max_s": 0.004},
            ["samples come unevenly: intervals are 2.1 ms rms from their period of 10 ms, at most 4 ms"],
        ),
        ({"rate_hz": 1000.0, "jitter_rms_s": 0.00019}, []),
        (
            {"rate_hz": 1000.0, "jitter_rms_s": 0.00021, "jitter_max_s": 0.001},
            ["samples come unevenly: intervals are 0.21 ms rms from their period of 1 ms, at most 1 ms"],
        ),
        ({"recorder_s": (0.5, 1.4)}, []),
        (
            {"recorder_s": (0.5, 1.6)},
            [
                "the recorder's time leads the stamps by 0.5 to 1.6 s: the stamps come from several clocks, or "
                "messages were held up"
            ],
        ),
    ],
)
def test_stamps(plain: Inspection, change: Mapping[str, Any], said: list[str]) -> None:
    still = {"rate_hz": 100.0, "jitter_rms_s": 0.0, "jitter_max_s": 0.0}
    found = timed(plain, *[still | dict(change)] * 3)
    assert told(found, "time") == [f"robots 1, 2 and 3: {sentence}" for sentence in said]


# Channels


def _stretch(start_s: float, duration_s: float) -> Stretch:
    return Stretch(start_s, duration_s, value=0.25, jumps=False)


def test_a_channel_that_is_cut_off(plain: Inspection) -> None:
    found = with_channel(plain, 0, "theta_y", clipped=(_stretch(1.0, 0.5),), clipped_count=7)
    (said,) = told(found, "samples")
    assert said == "omnid1.theta_y is cut off at 0.25: it stays there 7 times, longest from 1.00 s for 0.50 s"


@pytest.mark.parametrize(
    ("name", "low", "high"),
    [
        ("phi2", DESIGN.phi_min_rad, DESIGN.phi_max_rad),
        ("theta_y", -DESIGN.gimbal_limit_rad, DESIGN.gimbal_limit_rad),
        ("tau3", -2.0 * DESIGN.torque_limit_Nm, 2.0 * DESIGN.torque_limit_Nm),
    ],
)
def test_limits(plain: Inspection, name: str, low: float, high: float) -> None:
    inside, beyond = 0.99, 1.01
    assert told(with_channel(plain, 0, name, lowest=inside * low, highest=inside * high), "samples") == []
    unit = "N m" if name == "tau3" else "rad"
    rest = f"{unit}, beyond the range of {low:.4g} to {high:.4g}"
    for ends in ((beyond * low, inside * high), (inside * low, beyond * high)):
        (said,) = told(with_channel(plain, 0, name, lowest=ends[0], highest=ends[1]), "samples")
        assert said == f"omnid1.{name} reaches {ends[0]:.4g} to {ends[1]:.4g} {rest}"


# Clocks


def clocks(offset_s: float, error_s: float, drift: float = 0.0, drift_se: float = np.nan) -> ClockEstimate:
    covariance = np.full((3, 2, 2), np.nan)
    covariance[1] = np.diag([error_s**2, drift_se**2])
    return ClockEstimate(
        middle_s=3.0,
        offset_s=np.array([0.0, offset_s, np.nan]),
        drift=np.array([0.0, drift, np.nan]),
        covariance=covariance,
        mismatch=np.zeros(3),
        repeats_s=np.full(3, np.nan),
        reports=(),
        why_not=(None, None, "it hardly turns"),
    )


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (clocks(1.9e-4, 1e-5), None),
        (clocks(2.1e-4, 1e-5), "0.21 +- 0.01 ms ahead of"),
        (clocks(-2e-3, 3.9e-4), "2 +- 0.39 ms behind"),
        (clocks(-2e-3, 4.1e-4), None),
        (clocks(0.01, 1e-4, 20e-6, 4.1e-6), "10 +- 0.1 ms ahead of"),
        (clocks(0.01, 1e-4, 20e-6, 3.9e-6), "10 +- 0.1 ms ahead of"),
    ],
)
def test_clocks_that_differ(plain: Inspection, given: ClockEstimate, said: str | None) -> None:
    found = told(replace(plain, clocks=given), "clocks")
    drifts = " and drifts by +20 +- 3.9 ppm" if given.covariance[1, 1, 1] < 4e-6**2 else ""
    sentence = f"the clock of robot 2 is {said} that of robot 1{drifts}: convert with --clock correct"
    assert found == ([] if said is None else [sentence])


# Motion and forces


def test_verdicts() -> None:
    def ready(*reasons: str | None) -> Readiness:
        names = ("grasps", "mass", "centre of mass", "inertia")
        return Readiness((), 0, None, dict(zip(names, reasons, strict=True)), ())

    assert verdict(ready(None, None, None, None)) == "grasps yes, mass yes, centre of mass yes, inertia yes"
    assert verdict(ready(None, None, "why", "why")) == (
        "grasps yes, mass yes, centre of mass no (why), inertia no (why)"
    )
    assert verdict(ready("why", "why", "why", "why")) == "nothing (why)"


def test_how_streams_and_channels_are_shown(plain: Inspection) -> None:
    found = timed(
        plain,
        {
            "first_ns": 5 * S,
            "last_ns": 11 * S,
            "rate_hz": 99.5,
            "jitter_rms_s": 0.0012,
            "jitter_max_s": 0.034,
            "gaps": 2,
        },
        {"first_ns": None, "last_ns": None},
        {"first_ns": 6 * S, "last_ns": 9 * S, "rate_hz": None, "jitter_rms_s": 0.0, "jitter_max_s": 0.0},
    )  # fmt: skip
    for robot in range(3):
        bounds = {"lowest": -0.2 - robot, "highest": 0.1 * robot}
        found = with_channel(found, robot, "phi1", **bounds, step=0.001 * (robot + 1), noise=0.01 * robot)
        found = with_channel(found, robot, "phi2", lowest=None, highest=None)
        found = with_channel(found, robot, "phi3", step=0.5, noise=0.0)
        found = with_channel(found, robot, "tau1", step=None, noise=0.0)
    found = replace(
        found,
        survey=replace(found.survey, excerpt_s=(10.0, 20.4)),
        checked=((0.0, 2.5), (3.0, 2.0)),
        unchecked=None,
        segments=Segments(7.5, 12.0, ((0.0, 7.0),)),
        assumed_design=True,
    )
    lines = [line.split() for line in format_inspection(found).splitlines()]
    assert ["1", "600", "0.000", "6.000", "99.5", "1.2,", "34", "2"] in lines
    assert ["2", "0"] in lines
    assert ["3", "600", "1.000", "4.000", "-", "0,", "0", "0"] in lines
    assert ["phi1", "-2.2", "0.2", "0.003", "0.02", "rad"] in lines
    assert ["phi2", "no", "finite", "samples"] in lines
    assert [line[3:] for line in lines if line[:1] == ["phi3"]] == [["0.5", "<", "step", "rad"]]
    assert [line[3:] for line in lines if line[:1] == ["tau1"]] == [["none", "0", "N", "m"]]
    shown = format_inspection(found)
    assert "3 robots, joint level, 9 channels each" in shown
    assert "those of the Omnid are assumed" in shown
    assert "4.5 s in 2 stretches without gaps, the liveliest part of a long log (10 to 20 s)" in shown
    assert "still 7.5 s, moving 12.0 s, 1 rests of 6 s and more" in shown
    once = format_inspection(replace(found, checked=((0.0, 2.5),), segments=Segments(1.0, 2.0, ())))
    assert "2.5 s, the liveliest" in once
    assert "still 1.0 s, moving 2.0 s\n" in once
