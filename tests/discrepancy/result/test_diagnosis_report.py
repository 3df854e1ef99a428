"""The report and the pictures of a diagnosis, from numbers made up."""

from __future__ import annotations

import math
import string
from pathlib import Path

import numpy as np
import pytest

from diagnosed import small_diagnosis
from discrepancy.candidate import Candidate
from discrepancy.numbers import number
from discrepancy.team.linear.whitening import Whitening
from discrepancy.result.json import plain
from discrepancy.result.pictures.plots import file_names
from discrepancy.result.pictures.plots_evidence import closed_loop_figure
from discrepancy.result.lines import WIDTH, format_diagnosis, probability_words
from discrepancy.result.text_gain import ERRORS, response_units
from discrepancy.result.traces import Trace, group_units, groups
from discrepancy.channel import Channel
from discrepancy.team.causes import CAUSES
from discrepancy.team.causes.base import Cause
from discrepancy.team.estimates import errors
from discrepancy.team.traces import unwhitened
from discrepancy.team.words import TeamWords
from mocobot_sim.effects.catalogue import EFFECTS


def test_verdict_comes_first_and_lines_are_short() -> None:
    text = format_diagnosis(small_diagnosis())
    assert text.startswith(
        "EXPLAINED. Robot 2, joint 1: the torque sensor reads 0.0500 +- 0.0010 N m too much."
    )
    assert max(map(len, text.splitlines())) <= WIDTH
    for words in (
        "Explains 99 % of the misfit in sample, 98 % on held-out trials (a gain on 2 of 2 folds).",
        "[[Cause 1: torque zero of joint 1 of robot 2 (sea_bias)]]",
        "Probability 80 %, 180 nats over nothing in its place; else spring stiffness of joint 1 of robot 2 (10 %), "
        "something unlisted that looks like it (10 %).",
        "Cannot be told from: spring stiffness of joint 1 of robot 2 by 2.0 nats.",
        "A known weight separates them.",
        "99.0 % of the excess error removed (95 % interval over 2 trials: 90.0 to 100.0 %)",
        "A note.",
        "this: of that; needs a weight.",
        "chi2/n is 12 as simulated",
    ):
        assert words in " ".join(text.split())


def test_consistent_data_have_a_short_report() -> None:
    text = format_diagnosis(small_diagnosis("consistent"))
    assert text.startswith("CONSISTENT.")
    assert len(text.splitlines()) <= 24
    assert "cannot decide" not in text
    assert "torque zero of a driven joint (sea_bias): bias 19 to 21 mN m" in text
    assert "encoder zero of a driven joint (phi_zero): zero 0.04 mrad" in text  # the unit of the next one
    assert "encoder zero of a gimbal axis (theta_zero): zero 0.6 mrad (not everywhere)" in text
    assert "mass that swings in the payload (slosh): mass never" in text


def test_unexplained_data_say_where_the_misfit_is() -> None:
    values = small_diagnosis("unexplained")
    values["residual"] |= {"chi2_per_n": 5.0}
    text = format_diagnosis(values)
    assert text.startswith("UNEXPLAINED. The 2 recordings and the simulation differ")
    assert "What is left: somewhere." in text
    assert "would have been noticed" not in text


def test_miscalibrated_robots_are_to_be_calibrated() -> None:
    text = format_diagnosis(small_diagnosis("miscalibrated"))
    assert text.startswith("MISCALIBRATED. The robots of the 2 recordings are off")
    assert max(map(len, text.splitlines())) <= WIDTH
    said = " ".join(text.split())
    assert "Zero of a gimbal axis: a spread of 5.2 mrad over 9 places (tolerance 0.1 mrad)." in said
    assert '"mocobot calibrate" does so for a team' in said
    assert "with nothing named and everything a little off, as far as its kind scatters" in said
    assert "What would have been noticed" in text


@pytest.mark.parametrize(
    ("verdict", "shown"), [("miscalibrated", True), ("explained", True), ("consistent", False)]
)
def test_the_payload_is_told_without_and_with_what_is_off(verdict, shown) -> None:
    values = small_diagnosis(verdict)
    better = values["gain"]["estimates"]["before"] | {"mass_kg": 10.5}
    values["gain"]["estimates"] = {"before": better | {"mass_kg": 10.9}, "after": better}
    values["gain"]["errors"] = {"before": dict.fromkeys(ERRORS, 4.0), "after": dict.fromkeys(ERRORS, 0.25)}
    lines = [line.split() for line in format_diagnosis(values).splitlines()]
    assert (["mass", "[kg]", "10.9", "10.5"] in lines) == shown
    assert ["mass", "[%]", "4", *(["0.25"] if shown else [])] in lines


def test_a_suspicion_is_told_with_its_probability() -> None:
    values = small_diagnosis("consistent")
    entry = small_diagnosis()["causes"][0]
    values["suspected"] = [entry | {"at": None, "probability": 0.41, "over_nothing": 4.0}]
    text = " ".join(format_diagnosis(values).split())
    assert (
        "torque zero of joint 1 of robot 2 (sea_bias), probability 41 %: Robot 2, joint 1: the torque" in text
    )


@pytest.mark.parametrize(
    ("share", "words"),
    [(0.0004, "below 0.1 %"), (0.0312, "3.1 %"), (0.094, "9.4 %"), (0.096, "10 %"), (0.5, "50 %"), (0.9951, "99.5 %"),
     (0.99995, "above 99.9 %")],
)  # fmt: skip
def test_a_probability_in_words(share: float, words: str) -> None:
    assert probability_words(share) == words


def test_a_rival_that_the_closed_loop_rules_out() -> None:
    values = small_diagnosis()
    values["causes"][0]["alternatives"][0] |= {"ambiguous": False, "evidence_gap": -3.0, "chi2_per_n": 40.0}
    text = " ".join(format_diagnosis(values).split())
    assert "spring stiffness of joint 1 of robot 2 (3 nats better in the rows, closed loop chi2/n 40)" in text
    assert "Cannot be told" not in text


def test_errors_against_the_truth_are_shown() -> None:
    values = small_diagnosis()
    estimate = values["gain"]["estimates"]["before"]
    off = estimate | {"mass_kg": 11.7 * 1.01, "p_1c_m": [0.1, 0.2, 0.303]}
    found = errors(off, estimate)
    assert found["mass_percent"] == pytest.approx(1.0)
    assert found["com_mm"] == pytest.approx(3.0)
    assert found["grasp_rotation_deg"] == 0.0
    values["gain"]["errors"] = {"before": found, "after": errors(estimate, estimate)}
    assert "centre of mass [mm]" in format_diagnosis(values)
    with pytest.raises(ValueError, match="not"):
        errors(estimate, estimate | {"p_1c_m": [0.1, 0.2]})


def test_causes_are_named_in_words_where_they_sit() -> None:
    robot, joint = 3, 2
    for cause in CAUSES.values():
        at = getattr(cause, "per", "payload")
        place = (None if at == "payload" else robot, joint if at == "joint" else None)
        candidate = cause.candidate({}, {}, *place)
        for words in (candidate.kind, candidate.label):
            assert cause.title
            assert cause.name not in words or cause.name in (
                "push",
                "tether",
                "drag",
                "mass",
                "delay",
                "backlash",
            )
            assert not set("_{}()") & set(words)
        assert ("robot 3" in candidate.label) == (at != "payload")
        assert (" 2 of robot 3" in candidate.label) == (at == "joint")
    assert CAUSES["joint_friction"].candidate({}, {}, 3, 2).label == "friction in joint 2 of robot 3"
    assert CAUSES["gimbal_friction"].candidate({}, {}, 3, 2).label == "friction in gimbal axis 2 of robot 3"
    assert CAUSES["grasp_flex"].candidate({}, {}, 1).label == "compliance of the grasp of robot 1"
    assert CAUSES["clock_delay"].candidate({}, {}, 1).label == "clock delay of robot 1"
    assert Candidate("made_up", "", 2, None, ()).label == "made up (robot 2)"


def test_a_share_beyond_the_first_is_a_further_one() -> None:
    values = small_diagnosis()
    second = values["causes"][0] | {"explained": {"in_sample": 0.01, "held_out": None}}
    values["causes"].append(second)
    text = " ".join(format_diagnosis(values).split())
    assert text.count("Explains 99 % of") == 1
    assert "Explains a further 1 % of the misfit in sample" in text
    for share, words in (
        (0.0, "0 %"),
        (0.00067, "0.07 %"),
        (-0.00067, "-0.07 %"),
        (1e-6, "less than 0.001 %"),
    ):
        second["explained"]["in_sample"] = share
        text = " ".join(format_diagnosis(values).split())
        assert f"Explains a further {words} of the misfit in sample" in text


def test_what_fits_worse_at_several_instants_is_named_once() -> None:
    values = small_diagnosis()
    push = values["causes"][0]["alternatives"][0] | {"name": "push", "ambiguous": False, "chi2_per_n": None}
    gaps = (30.0, 40.0, 50.0)
    values["causes"][0]["alternatives"] += [push | {"evidence_gap": gap} for gap in gaps]
    values["causes"][0]["alternatives"].append(push | {"name": "drag", "evidence_gap": 60.0})
    text = " ".join(format_diagnosis(values).split())
    assert "Fits worse: push (30 nats worse), drag (60 nats worse)." in text


@pytest.mark.parametrize("cause", sorted(CAUSES))
def test_every_cause_has_a_sentence_with_its_numbers(cause: str) -> None:
    kind = CAUSES[cause]
    robot, joint = (None if kind.per == "payload" else 2), (3 if kind.per == "joint" else None)
    candidate = Candidate(cause, kind.family, robot, joint, ())
    names = EFFECTS[cause].parameter_names()
    for sign in (1.0, -1.0):
        values = {name: sign * 0.0123 for name in names} | ({"trial": 2.0} if cause == "push" else {})
        text = TeamWords().describe(candidate, values, dict.fromkeys(names, 1e-4) | {"trial": math.nan})
        assert text.endswith(".")
        assert text[0] in string.ascii_uppercase
        assert "+-" in text
        assert ("Robot 2" in text) == (robot is not None)
        assert "_" not in text


def test_a_cause_of_ones_own_gets_its_docstring(monkeypatch: pytest.MonkeyPatch) -> None:
    class Mine(Cause):
        """A ghost holds the payload back."""

        at = "payload"
        columns = type(CAUSES["drag"]).columns

    monkeypatch.setitem(CAUSES, "ghost", Mine())
    text = TeamWords().describe(Candidate("ghost", "f", None, None, ()), {"c_N": 2.0}, {"c_N": 0.1})
    assert text == "Payload: A ghost holds the payload back (c_N = 2.00 +- 0.10)."


def test_numbers_have_as_many_digits_as_they_deserve() -> None:
    assert number(0.05, 0.00123, "N m") == "0.0500 +- 0.0012 N m"
    assert number(-0.05, 1.0, "m", 1e3) == "-50 +- 1000 m"
    assert number(0.05, math.nan, "s") == "0.05 s"


def test_plain_values_have_no_nan() -> None:
    mixed = {"a": np.float64("nan"), "b": [np.int64(2), np.array([1.0, np.inf])], "c": np.bool_(True)}
    assert plain(mixed) == {"a": None, "b": [2, [1.0, None]], "c": True}


def test_file_names_are_distinct_and_safe() -> None:
    names = file_names(["/x/rec.parquet", "y/rec.parquet", "a b/c:d", "against", ""])
    assert names == ["rec", "rec_2", "c_d", "against_2", "trial"]


def test_channels_are_grouped_by_name() -> None:
    channels = [Channel(f"force {a}", "balance", None, "N") for a in "xyz"] + [Channel("gap", "k", 1, "m")]
    found = groups(channels)
    assert [(g.name, g.columns, g.components) for g in found] == [
        ("force", (0, 1, 2), ("x", "y", "z")),
        ("gap", (3,), ("gap",)),
    ]


def test_one_unit_for_all_channels_of_a_kind() -> None:
    """That of the largest rms, over groups and trials."""
    names = {"grasp 2 rotation": "rad", "grasp 3 rotation": "rad", "force": "N", "moment": "N m"}
    channels = [Channel(f"{name} {a}", "k", None, unit) for name, unit in names.items() for a in "xy"]
    sizes = np.array([2e-5, 1e-5, 3e-4, 1e-5, 2.0, 1.0, 0.03, 0.2])
    wave = np.sqrt(2.0) * np.cos(np.linspace(0.0, 20.0 * np.pi, 1000, endpoint=False))[:, None]
    one = np.ones((1000, 8))
    traces = [
        Trace(name, np.arange(1000.0), 1000, 1.0, scale * sizes * wave, one, one, one, one, {})
        for name, scale in (("small", 0.1), ("large", 1.0))
    ]
    assert group_units(traces, groups(channels)) == {
        "rad": ("mrad", 1e3),
        "N": ("N", 1.0),
        "N m": ("N m", 1.0),
    }
    gain = small_diagnosis()["gain"]
    gain["held_out"]["before"] = gain["held_out"]["before"] | {
        "phi_rms": 3e-5,
        "theta_rms": 2e-3,
        "tau_rms": 0.3,
    }
    gain["trials"] = []
    shown = response_units(gain)
    assert shown == {"phi": ("mrad", 1e3), "theta": ("mrad", 1e3), "tau": ("N m", 1.0)}


@pytest.mark.parametrize("uneven", [False, True])
def test_whitening_can_be_undone(uneven: bool) -> None:
    rng = np.random.default_rng(1)
    draws = np.cumsum(rng.standard_normal((20, 60, 4)), axis=1) * 0.1 + rng.standard_normal((20, 60, 4))
    draws[:, :3] *= 5.0
    white = Whitening.of(draws, 50, uneven=uneven)
    assert np.any(white.loudness > 1.0) == uneven
    assert unwhitened(white, white(draws[0])) == pytest.approx(draws[0], abs=1e-10)


def test_no_closed_loop_no_picture(tmp_path: Path) -> None:
    values = small_diagnosis()
    figure = closed_loop_figure(values)
    assert figure is not None
    figure.savefig(tmp_path / "loop.png")
    assert len(figure.axes) == 4
    values["gain"]["trials"] = []
    assert closed_loop_figure(values) is None
