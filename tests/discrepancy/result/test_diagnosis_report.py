"""The report and the pictures of a diagnosis, from numbers made up."""

from __future__ import annotations

import math
import string
from typing import Any

import pytest

from diagnosed import scattered, small_diagnosis
from discrepancy.candidate import Candidate
from discrepancy.result.remains import of_response
from discrepancy.result.report import format_verdict
from discrepancy.result.tables import ERRORS
from discrepancy.team.causes import CAUSES
from discrepancy.team.causes.base import Cause
from discrepancy.team.estimates import errors
from discrepancy.team.told import describe
from mocobot_sim.effects.catalogue import EFFECTS

WIDTH = 100


def report(values: dict[str, Any]) -> str:
    """All that there is to say, its lines joined."""
    return " ".join(format_verdict(values, verbose=True).split())


@pytest.mark.parametrize(
    ("verdict", "begins", "says"),
    [
        ("explained", "EXPLAINED: one finding accounts for what the model gets wrong in the 2 trials. The team differs "
         "from its model by torque zero of joint 1 of robot 2 or spring stiffness of joint 1 of robot 2.",
         ("2 of 2 trials are likelier with that, all together by 7 nats",
          "robot 2, joint 1 torque zero 50.0 +- 1.0 mN m 80 %",
          "Robot 2, joint 1: the torque sensor reads 0.0500 +- 0.0010 N m too much.",
          "Explains 99 % of the misfit in sample, 98 % on held-out trials (a gain on 2 of 2 folds).",
          "180 nats over nothing in its place; else spring stiffness of joint 1 of robot 2 (10 %), something unlisted "
          "that looks like it (10 %)", "A known weight separates them.", "this: of that; needs a weight.", "A note.",
          "99.0 % of the excess error removed (95 % interval over 2 trials: 90.0 to 100.0 %)",
          "chi2/n is 12 as modelled")),
        ("partly_explained", "PARTLY EXPLAINED: one finding accounts for a part of what the model gets wrong", ()),
        ("consistent", "CONSISTENT: the model explains the 2 trials within noise and tolerances.",
         ("torque zero of a driven joint (sea_bias): bias 19 to 21 mN m",
          "encoder zero of a driven joint (phi_zero): zero 0.04 mrad",
          "encoder zero of a gimbal axis (theta_zero): zero 0.6 mrad (not everywhere)",
          "mass that swings in the payload (slosh): mass never")),
        ("unexplained", "UNEXPLAINED: no cause of the tables accounts for", ("at which speed, place and load",)),
        ("miscalibrated", "MISCALIBRATED: in the 2 trials all places of a kind are off by more than their tolerances.",
         ('"mocobot calibrate" does so for a team', "9 places zero of a gimbal axis", "52.0 times the tolerance",
          "robot 2, joint 3 -9.10 +- 0.20", "and 5 more", "as far as its kind scatters")),
    ],
)  # fmt: skip
def test_each_verdict_comes_first_in_short_lines(verdict: str, begins: str, says: tuple[str, ...]) -> None:
    values = small_diagnosis(verdict)
    assert report(values).startswith(begins)
    for words in says:
        assert words in report(values)
    assert max(map(len, format_verdict(values, verbose=True).splitlines())) <= WIDTH


@pytest.mark.parametrize(
    ("verdict", "shown"), [("miscalibrated", True), ("explained", True), ("consistent", False)]
)
def test_the_payload_is_told_without_and_with_what_is_off(verdict: str, shown: bool) -> None:
    values = small_diagnosis(verdict)
    better = values["gain"]["estimates"]["before"] | {"mass_kg": 10.5}
    values["gain"]["estimates"] = {"before": better | {"mass_kg": 10.9}, "after": better}
    values["gain"]["errors"] = {"before": dict.fromkeys(ERRORS, 4.0), "after": dict.fromkeys(ERRORS, 0.25)}
    lines = [line.split() for line in format_verdict(values, verbose=True).splitlines()]
    assert (["mass", "[kg]", "10.9", "10.5"] in lines) == shown
    assert ["mass", "[%]", "4", *(["0.25"] if shown else [])] in lines


def test_why_nothing_was_simulated_is_told() -> None:
    why = "trial 1 has no commands"
    assert f"A note. The closed loop was not simulated: {why}." in report(
        small_diagnosis() | {"not_simulated": why}
    )
    assert "not simulated" not in report(small_diagnosis())


@pytest.mark.parametrize(("share", "told"), [(0.79, True), (0.81, False)])
def test_a_response_that_causes_hardly_mend_is_told(share: float, told: bool) -> None:
    values = small_diagnosis()
    values["gain"]["held_out"]["after"] |= {"chi2_per_n": 3.1}
    values["gain"]["removed"]["share"] = share
    assert bool(of_response(values)) == told
    values["gain"]["held_out"]["after"] |= {"chi2_per_n": 2.9}
    assert of_response(values) == []


def test_a_response_with_parts_as_they_are_found_is_told() -> None:
    values = small_diagnosis()
    found = values["gain"]["held_out"]["after"] | {"chi2_per_n": 12.34}
    as_found = "12.3 with every part as far off as it is found, within its tolerance, too"
    assert as_found not in report(values)
    values["gain"]["held_out"] |= {"as_found": found}
    assert f"chi2/n {as_found}" in report(values)
    values["gain"]["held_out"]["after"] |= {"chi2_per_n": 69.0}
    values["gain"]["removed"]["share"] = 0.4
    (said,) = of_response(values)
    assert said.endswith(f"by chi2/n 69 (90 without them; noise alone leaves 1), by {as_found}.")
    values = small_diagnosis("consistent")
    both = dict.fromkeys(("before", "after"), found | {"chi2_per_n": 6123.0})
    values["gain"]["held_out"] = both | {"as_found": found}
    first, last = of_response(values)
    assert "off by chi2/n 6120, where noise alone leaves 1" in first
    assert "tolerances" in first
    assert last == f"It is by {as_found}."


def test_what_is_off_everywhere_beside_a_cause_has_its_rows() -> None:
    values = small_diagnosis()
    values["scatter"] = [scattered()]
    text = report(values)
    assert text.startswith("EXPLAINED")
    assert (
        "9 places zero of a gimbal axis zero [mrad] 52.0 times the tolerance robot 2, joint 3 -9.10" in text
    )


def test_errors_against_the_truth_are_shown() -> None:
    values = small_diagnosis()
    estimate = values["gain"]["estimates"]["before"]
    off = estimate | {"mass_kg": 11.7 * 1.01, "p_1c_m": [0.1, 0.2, 0.303]}
    found = errors(off, estimate)
    assert found["mass_percent"] == pytest.approx(1.0)
    assert found["com_mm"] == pytest.approx(3.0)
    assert found["grasp_rotation_deg"] == 0.0
    values["gain"]["errors"] = {"before": found, "after": errors(estimate, estimate)}
    assert "centre of mass [mm]" in report(values)
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


@pytest.mark.parametrize("cause", sorted(CAUSES))
def test_every_cause_has_a_sentence_with_its_numbers(cause: str) -> None:
    kind = CAUSES[cause]
    robot, joint = (None if kind.per == "payload" else 2), (3 if kind.per == "joint" else None)
    candidate = Candidate(cause, kind.family, robot, joint, ())
    names = EFFECTS[cause].parameter_names()
    for sign in (1.0, -1.0):
        values = {name: sign * 0.0123 for name in names} | ({"trial": 2.0} if cause == "push" else {})
        text = describe(candidate, values, dict.fromkeys(names, 1e-4) | {"trial": math.nan})
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
    text = describe(Candidate("ghost", "f", None, None, ()), {"c_N": 2.0}, {"c_N": 0.1})
    assert text == "Payload: A ghost holds the payload back (c_N = 2.00 +- 0.10)."
