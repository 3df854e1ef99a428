"""What is written of the engine's own answers, on a rig of pure numbers."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

from diagnosed import check_finite
from discrepancy import rules
from discrepancy.engine.diagnose import diagnose
from discrepancy.result.json import diagnosis_to_dict
from discrepancy.result.pictures.plots_evidence import evidence_figure
from discrepancy.result.text import WIDTH, format_diagnosis
from fake_rig import CATALOGUE, TWINS, FakeRig, cause

NINE = tuple(cause("zero", robot=1 + k) for k in range(9)) + CATALOGUE[:3]
SCATTERED = dict(enumerate([18.0, -25.0, 7.0, 31.0, -12.0, -20.0, 15.0, 28.0, -9.0]))


class Words:
    """Of nothing in particular."""

    def describe(self, candidate: Any, values: Any, se: Any) -> str:
        return f"It is {candidate.label}."

    def separate(self, name: str) -> str:
        return ""

    def unit(self, name: str) -> str:
        return "m"


class Pushed(FakeRig):
    """The transient of ``FakeRig`` is there."""

    def __post_init__(self):
        super().__post_init__()
        (push,) = self.transients([])
        x, local, shared = self.data[1]
        self.data[1] = x + self.columns(push)[1] @ np.array([3.0, -2.0]), local, shared


@cache
def written(case: str) -> dict[str, Any]:
    rigs = {
        "one": FakeRig({2: 25.0}),
        "twins": FakeRig({2: 25.0}, twins=TWINS),
        "none": FakeRig({}),
        "foreign": FakeRig({}, foreign=1.0),
        "scatter": FakeRig(SCATTERED, catalogue=NINE),
        "akin": FakeRig({2: 25.0}, twins={4: (2, 0.05)}),
        "burst": Pushed({}, burst=(1, 0.0, 2)),
    }
    rig = rigs[case]
    values = diagnosis_to_dict(diagnose(rig), rig, Words())  # pyright: ignore[reportArgumentType]
    check_finite(values)
    text = format_diagnosis(values)
    assert max(map(len, text.splitlines())) <= WIDTH
    evidence_figure(values)
    return values


@pytest.mark.parametrize("case", ["one", "akin"])
def test_probabilities_of_all_that_may_be_there_add_up(case: str) -> None:
    assert written(case)["causes"]
    for named in written(case)["causes"]:
        listed = [rival["probability"] for rival in named["alternatives"]]
        whole = named["probability"] + sum(listed) + sum(named["instead"].values())
        assert whole == pytest.approx(1.0)
        assert min([*listed, *named["instead"].values()]) >= 0.0
        for rival in named["alternatives"]:
            odds = np.log(named["probability"] / rival["probability"])
            assert odds == pytest.approx(min(rival["evidence_gap"], 700.0), abs=1e-6)


def test_a_named_cause_has_the_evidence_it_needs_and_nothing_else_afterwards() -> None:
    values = written("one")
    assert [entry["cause"] for entry in values["causes"]] == ["cause 2"]
    first, *others = values["evidence"]["before"]
    assert first["cause"] == "cause 2"
    assert first["nats"] > first["needed"]
    assert all(entry["nats"] < entry["needed"] for entry in [*others, *values["evidence"]["after"]])
    # Log of the prior odds apart, it is what the search found it to be worth.
    prior = rules.NAMED_NATS - first["needed"]
    assert first["nats"] + prior == pytest.approx(values["causes"][0]["over_nothing"], rel=0.05)


def test_of_two_that_look_alike_one_is_named_beside_the_other() -> None:
    values = written("twins")
    (one,) = values["causes"]
    (other,) = [rival for rival in one["alternatives"] if rival["ambiguous"]]
    assert {one["cause"], other["cause"]} == {"cause 2", "cause 4"}
    assert 0.3 < one["probability"] < 0.6
    assert not values["suspected"]
    assert f"Cannot be told from: {other['name']}" in " ".join(format_diagnosis(values).split())


def test_nothing_to_tell() -> None:
    values = written("none")
    assert (values["verdict"], values["causes"], values["scatter"]) == ("consistent", [], [])
    assert values["evidence"]["after"] is None
    assert all(entry["nats"] < entry["needed"] for entry in values["evidence"]["before"])


def test_all_places_off_are_a_scatter() -> None:
    values = written("scatter")
    assert values["verdict"] == "miscalibrated"
    (entry,) = values["scatter"]
    size = np.sqrt(np.mean(np.square([*SCATTERED.values()])))
    assert (entry["cause"], entry["places"]) == ("zero", 9)
    assert entry["spread"]["p0"] == pytest.approx(size, rel=0.2)
    assert entry["tolerance"] == {"p0": 1.0}
    assert f"a spread of {entry['spread']['p0']:.2g}" in " ".join(format_diagnosis(values).split())


def test_an_unknown_misfit_is_told() -> None:
    values = written("foreign")
    assert values["verdict"] == "unexplained"
    assert values["residual"]["unlisted_nats"] > 30.0
    assert values["residual"]["chi2_per_n"] == pytest.approx(2.0, rel=0.1)  # noise, and as much again


def test_an_event_is_in_the_list_before_it_is_named() -> None:
    values = written("burst")
    (named,) = values["causes"]
    (entry,) = [e for e in values["evidence"]["before"] if e["at"]]
    assert entry["at"] == [2, 3.2]
    assert named["cause"] == entry["cause"] == "push"
    assert entry["nats"] > entry["needed"]


class AsFound(FakeRig):
    """A response that is off unless healthy parts are as they are found; one trial may not be simulated so."""

    whole, fails = True, False

    def simulation(self, trial, shared, local, active, healthy=()):
        failed = self.fails and healthy and trial == 1
        return lambda: None if failed else {"phi": np.full((10, 3), 1.5 if healthy else 4.0)}


@pytest.mark.parametrize("fails", [False, True])
def test_a_response_of_parts_as_found_is_of_all_trials_or_none(fails: bool) -> None:
    rig = AsFound({}, loop=lambda causes, trial: 16.0)
    rig.fails = fails
    values = diagnosis_to_dict(diagnose(rig), rig, Words())  # pyright: ignore[reportArgumentType]
    told = values["gain"]["held_out"]
    assert told["after"]["chi2_per_n"] == 16.0
    if fails:
        assert told["as_found"] is None
    else:
        assert told["as_found"]["chi2_per_n"] == 2.25
