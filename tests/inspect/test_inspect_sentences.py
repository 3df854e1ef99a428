"""From which number on something is worth a word, and what is then said: surveys made by hand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pytest

from array_log import ArrayLog, stream
from estimator.clocks import ClockEstimate
from estimator.estimate.uncertainty import StepReport, WeakDirection
from mocobot_inspect.channels import Oscillation, Stretch
from mocobot_inspect.findings import evidence, findings
from mocobot_inspect.grasps import Fault
from mocobot_inspect.report import format_inspection, verdict
from mocobot_inspect.team import Inspection, Readiness, Segments, idle_axes, inspect_log
from mocobot_inspect.team_wiring import Misfit, Wiring
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


def test_what_robots_share_is_said_once(plain: Inspection) -> None:
    twice = {"duplicates": 1}
    assert told(timed(plain, twice), "time") == ["robot 1: a stamp is repeated 1 time"]
    assert told(timed(plain, twice, twice), "time") == ["robots 1 and 2: a stamp is repeated 1 time"]
    three = told(timed(plain, twice, twice, {"duplicates": 2}), "time")
    assert three == ["robots 1 and 2: a stamp is repeated 1 time", "robot 3: a stamp is repeated 2 times"]


def test_rates_that_differ(plain: Inspection) -> None:
    assert told(timed(plain, {"rate_hz": 100.0}, {"rate_hz": 100.09}, {"rate_hz": 100.0}), "time") == []
    (said,) = told(timed(plain, {"rate_hz": 100.0}, {"rate_hz": 100.11}, {"rate_hz": 100.0}), "time")
    assert said == "the robots are sampled at different rates: 100, 100.11, 100 Hz"
    (few,) = told(timed(plain, {"rate_hz": None}), "time")
    assert few == "robot 1: 600 samples are too few"


def test_ends_that_are_far_apart(plain: Inspection) -> None:
    ends = {"first_ns": 10 * S, "last_ns": 20 * S}
    near = ends | {"first_ns": 10 * S + 900_000_000, "last_ns": 20 * S - 900_000_000}
    assert told(timed(plain, ends, near, ends), "time") == []
    late = ends | {"first_ns": 12 * S}
    early = ends | {"last_ns": 18 * S - S // 2}
    assert told(timed(plain, ends, late, early), "time") == [
        "robot 2 begins 2 s after the first of the others",
        "robot 3 ends 2.5 s before the last of the others",
    ]
    without = {"first_ns": None, "last_ns": None}
    assert told(timed(plain, without, without, late), "time") == []


# Channels


@pytest.mark.parametrize(
    ("stuck", "said"),
    [
        ([], []),
        ([(1.0, 2.0)], [" is stuck from 1.00 s for 2.00 s while others move"]),
        ([(1.0, 2.0), (4.0, 2.9)], [" is stuck 2 times, longest from 4.00 s for 2.90 s while others move"]),
        ([(1.0, 2.0), (4.0, 3.1)], [" stands at 0.25 for 5.1 of 10 s while others move: stuck"]),
    ],
)
def test_channels_that_stand(plain: Inspection, stuck: list[tuple[float, float]], said: list[str]) -> None:
    stretches = tuple(_stretch(start, duration) for start, duration in stuck)
    found = timed(plain, {"first_ns": 0, "last_ns": 10 * S})
    found = with_channel(found, 0, "theta_y", stuck=stretches, stuck_count=len(stuck))
    assert told(found, "samples") == [f"omnid1.theta_y{sentence}" for sentence in said]


def _stretch(start_s: float, duration_s: float) -> Stretch:
    return Stretch(start_s, duration_s, value=0.25, jumps=False)


def test_a_channel_that_is_cut_off(plain: Inspection) -> None:
    found = with_channel(plain, 0, "theta_y", clipped=(_stretch(1.0, 0.5),), clipped_count=7)
    (said,) = told(found, "samples")
    assert said == "omnid1.theta_y is cut off at 0.25: it stays there 7 times, longest from 1.00 s for 0.50 s"


def test_which_channels_stand(plain: Inspection) -> None:
    seconds = plain.survey.timing[1].duration_s
    short = with_channel(
        plain, 1, "tau1", stuck=(_stretch(0.0, 0.3 * seconds),), clipped=(_stretch(4.0, 1.0),)
    )
    (one,) = short.standing
    assert (one.channel, one.mostly) == ("omnid2.tau1", False)
    assert one.seconds == pytest.approx(0.3 * seconds + 1.0)
    (most,) = with_channel(plain, 2, "phi1", clipped=(_stretch(0.0, 0.51 * seconds),)).standing
    assert (most.channel, most.mostly) == ("omnid3.phi1", True)
    assert plain.standing == ()


def test_values_that_are_not_finite(plain: Inspection) -> None:
    assert told(with_channel(plain, 1, "theta_x", nans=3), "samples") == [
        "omnid2.theta_x: 3 NaN of 600 samples"
    ]
    both = with_channel(plain, 0, "phi1", nans=3, infinities=2)
    assert told(both, "samples") == ["omnid1.phi1: 3 NaN and 2 infinite of 600 samples"]


def test_the_largest_oscillation_of_an_effort_is_named(plain: Inspection) -> None:
    large = with_channel(plain, 0, "theta_z", oscillation=Oscillation(20.0, 0.9, 2.5))
    assert told(large, "samples") == [
        "omnid1.theta_z oscillates at 20 Hz, or what folds to that, by up to +-0.9 rad for 2.5 s: is a control loop "
        "unstable?"
    ]
    small = with_channel(large, 1, "tau2", oscillation=Oscillation(21.0, 0.4, 5.0))
    small = with_channel(small, 1, "tau1", oscillation=Oscillation(21.0, 0.3, 5.0))
    assert told(small, "samples") == [
        "omnid2.tau2 oscillates at 21 Hz, or what folds to that, by up to +-0.4 N m for 5 s, and omnid2.tau1 and "
        "omnid1.theta_z with it: is a control loop unstable?"
    ]
    for name in ("phi1", "phi2", "phi3"):
        small = with_channel(small, 2, name, oscillation=Oscillation(20.0, 0.1, 2.5))
    assert "and 5 other channels with it" in told(small, "samples")[0]


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


def test_many_channels_beyond_their_limits(plain: Inspection) -> None:
    names = [(0, "theta_z"), (0, "theta_y"), (1, "theta_z"), (1, "theta_y"), (2, "theta_x")]
    found = plain
    for k, (robot, name) in enumerate(names):
        found = with_channel(found, robot, name, lowest=-3.0 - k, highest=4.0 + k)
        (said,) = told(found, "samples")
        assert said.startswith("omnid1.theta_z reaches -3 to 4 rad" if k == 0 else "omnid1.theta_z")
    assert said.startswith(
        "omnid1.theta_z, omnid1.theta_y, omnid2.theta_z, omnid2.theta_y and 1 more reach -7 to 8 rad"
    )
    assert "full turn" not in said
    turned = with_channel(plain, 0, "theta_z", lowest=-np.pi + 0.01, highest=np.pi - 0.01)
    assert "full turn, which has to be taken out before (numpy.unwrap)?" in told(turned, "samples")[0]
    less = with_channel(plain, 0, "theta_z", lowest=-np.pi + 0.04, highest=np.pi - 0.04)
    assert "full turn" not in told(less, "samples")[0]


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


def test_clocks_are_told_in_any_case(plain: Inspection) -> None:
    shown = format_inspection(replace(plain, clocks=clocks(-1e-4, 2e-5, 3e-6, 1e-6)))
    line = "clocks against that of robot 1: robot 2 -0.1 +- 0.02 ms, +3 +- 1 ppm; robot 3 not known (it hardly turns)"
    assert line in shown


# Motion and forces


def test_the_two_largest_disagreements_are_evidence() -> None:
    values = {
        "rotation": 0.01, "velocity": 0.02, "tilt": 0.03, "force": 0.04, "moment": 0.05, "angular speed": 0.06,
        "lift": 0.07,
    }  # fmt: skip
    said = {}
    for name in values:
        scaled = dict.fromkeys(values, 0.1) | {name: 3.0, "lift" if name != "lift" else "tilt": 2.0}
        first, _, second = evidence(Misfit(values, scaled, (), True)).partition(" and ")
        said[name] = first
        assert second.startswith("vertical forces" if name != "lift" else "directions of gravity")
    assert said == {
        "rotation": "angular velocities of the robots differ by 1 % of their rms",
        "velocity": "velocities of the robots differ by 2 % of their rms",
        "tilt": "directions of gravity differ by 1.7 deg",
        "force": "4 % of the forces do not add up",
        "moment": "moments do not add up by 5 % of the forces' levers",
        "angular speed": "angular speeds of the robots differ by 6 % of their rms",
        "lift": "vertical forces do not add up to one weight by 7 %",
    }


def test_total_misfit() -> None:
    scaled = {"rotation": 1.0, "force": 3.0}
    assert Misfit(scaled, scaled, (), True).total == pytest.approx(5.0)
    assert Misfit(scaled, scaled, (), True, parts=5).total == pytest.approx(2.0)
    assert Misfit({}, {}, (), True).total == 0.0
    assert not Misfit(scaled, {"force": 1.4}, (), True).suspicious
    assert Misfit(scaled, {"force": 1.43}, (), True).suspicious


@pytest.mark.parametrize(("size", "idle"), [(0.09, ["pitch"]), (0.11, [])])
def test_axes_that_are_hardly_turned_about(size: float, idle: list[str]) -> None:
    rng = np.random.default_rng(1)
    q, _ = np.linalg.qr(rng.standard_normal((1000, 3)))
    omega = np.sqrt(1000) * q * [1.0, size, 0.5]
    assert idle_axes(omega, 0.0) == idle
    assert sorted(idle_axes(omega, 10.0)) == ["pitch", "roll", "yaw"]


def test_an_oblique_axis_has_no_name() -> None:
    rng = np.random.default_rng(1)
    q, _ = np.linalg.qr(rng.standard_normal((1000, 3)))
    for degrees, idle in ((18.0, ["pitch"]), (22.0, [])):
        c, s = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        assert idle_axes(np.sqrt(1000) * (q * [1.0, 0.01, 0.7]) @ turn.T, 0.0) == idle


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


def test_a_missing_robot_is_suspected_where_only_forces_do_not_fit(plain: Inspection) -> None:
    hint = ": they move together, so does the log lack a robot, or does something else carry or push?"
    said = {}
    for name, scaled, determined in (
        ("forces", {"rotation": 1.0, "velocity": 1.4, "force": 9.0}, True),
        ("motion", {"rotation": 1.0, "velocity": 1.42, "force": 9.0}, True),
        ("open", {"rotation": 1.0, "force": 9.0}, False),
    ):
        misfit = Misfit(scaled, scaled, () if determined else (Fault(1.0, "why"),), determined)
        wiring = Wiring(misfit, (), misfit, (), 10)
        (sentence,) = told(replace(plain, wiring=wiring), "wiring")
        assert sentence.startswith("the channels do not fit robots that carry one rigid payload (")
        assert "no mistake that is looked for explains it" in sentence
        said[name] = sentence.endswith(hint)
    assert said == {"forces": True, "motion": False, "open": False}


def test_excitation_is_shown(plain: Inspection) -> None:
    weak = WeakDirection("rotation R_12", "about x of {1}", (1.0, 0.0, 0.0), "why not")
    step = StepReport("rotation R_12", ("a", "b"), "rad/s", (0.5, 0.01), 0.02, (weak,))
    ready = Readiness((step,), 3, (0.1, 0.2, 0.3), dict.fromkeys(("grasps", "mass"), "why"), ())
    lines = format_inspection(replace(plain, ready=ready)).splitlines()
    at = lines.index("[[Excitation]]  3 static holds")
    assert [line.strip() for line in lines[at + 1 : at + 4]] == [
        "turning [rad/s rms]: 0.1 roll; 0.2 pitch; 0.3 yaw",
        "rotation R_12: rank 1 of 2, condition 50, weakest signal 0.01 rad/s, noise 0.02",
        "weak about x of {1}: why not",
    ]
    undone = format_inspection(replace(plain, ready=ready, ready_undone=replace(ready, axes=None)))
    assert "[[Excitation, with all mistakes found undone]]  3 static holds" in undone
    assert "turning" not in undone
    assert "[[Excitation" not in format_inspection(replace(plain, ready=replace(ready, steps=())))


class Hidden(NamedTuple):
    """As much of a mistake as its words need."""

    subject: str
    who: str


def test_mistakes_that_would_not_show(plain: Inspection) -> None:
    def shown(*mistakes: Hidden) -> str:
        well = Misfit({"rotation": 0.01}, {"rotation": 1.0}, (), True)
        text = format_inspection(replace(plain, wiring=Wiring(well, (), well, mistakes, 30)))
        (line,) = [line.strip() for line in text.splitlines() if "looked for" in line]
        return line.removeprefix("30 wiring mistakes were looked for")

    assert shown() == ""
    same = [
        Hidden("order of tau", "robot 1"),
        Hidden("order of tau", "robot 2"),
        Hidden("order of tau", "robot 1"),
    ]
    assert shown(*same) == "; 3 of them would not show here: order of tau (robot 1, robot 2)"
    every = [Hidden(f"kind {k}", "all robots") for k in range(8)]
    six = "; ".join(f"kind {k} (all robots)" for k in range(6))
    assert shown(*every[:6]) == f"; 6 of them would not show here: {six}"
    assert shown(*every[:7]) == f"; 7 of them would not show here: {six}; and 1 more"
    assert shown(*every) == f"; 8 of them would not show here: {six}; and 2 more"
