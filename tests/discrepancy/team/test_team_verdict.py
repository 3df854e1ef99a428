"""What a team's verdict on the small engine tells: causes with sizes and probabilities, JSON, text, folder."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from diagnosed import check_finite
from discrepancy.evidence.odds import odds_of
from discrepancy.joints.json import verdict_to_dict
from discrepancy.result.read import read_diagnosis
from discrepancy.result.report import format_verdict
from discrepancy.team.diagnose import TeamOutcome, search_team
from discrepancy.team.rig import TeamRig
from discrepancy.team.told import TeamDiagnosed
from discrepancy.team.tolerances import read_tolerances
from discrepancy.team.verdict import judged_team
from estimator.errors import InputError
from estimator.estimate.payload import estimate_payload
from hidden.generator import HiddenSet
from hidden_quick import generated, quick_set
from joint_verdicts import joint_verdict, offset_or_spring

WIDTH = 100


def searched(request: HiddenSet) -> tuple[TeamOutcome, dict[str, Any]]:
    """What a search finds, and the truth that is opened after it."""
    recordings, sealed = generated(request)
    estimate = estimate_payload(recordings, compare_masses=False, withhold=False)
    outcome = search_team(TeamRig.of(recordings, estimate, read_tolerances(None)))
    return outcome, sealed.open({"found": []})


def told(outcome: TeamOutcome) -> TeamDiagnosed:
    return TeamDiagnosed(judged_team(outcome, odds_of(outcome.search, outcome.state)), outcome)


@pytest.fixture(scope="module")
def faulty() -> tuple[TeamDiagnosed, dict[str, Any]]:
    """Of a torque's zero that is off."""
    outcome, truth = searched(quick_set("single", 2, "sea_bias", payload="b"))
    return told(outcome), truth


@pytest.fixture(scope="module")
def healthy() -> TeamDiagnosed:
    return told(searched(quick_set("clean", 6, payload="b"))[0])


def keys_of(values: Any) -> Any:
    """Keys at all depths; of numbers by name there are others at every machine."""
    free = ("parameters", "shape", "signature", "gain", "explained", "estimates", "spread", "tolerance")
    if isinstance(values, Mapping):
        return {key: None if key in free else keys_of(item) for key, item in values.items()}
    if isinstance(values, list) and values and isinstance(values[0], Mapping):
        return [keys_of(values[0])]
    return None


def first_part(text: str) -> str:
    return text.split("\n\n")[0].replace("\n", " ")


@pytest.mark.slow
def test_a_hidden_cause_is_named_with_its_size(faulty: tuple[TeamDiagnosed, dict[str, Any]]) -> None:
    found, truth = faulty
    values, (effect,) = found.to_dict(), truth["effects"]
    (cause,) = values["causes"]
    assert values["verdict"] == "explained"
    assert (cause["cause"], cause["robot"], cause["joint"]) == ("sea_bias", effect["robot"], effect["joint"])
    size = cause["parameters"]["bias_Nm"]
    assert size["value"] == pytest.approx(effect["parameters"]["bias_Nm"], abs=4.0 * size["se"])
    assert size["se"] < 0.1 * abs(size["value"])
    assert cause["probability"] > 0.9
    assert cause["over_nothing"] > 10.0
    assert len(cause["folds"]) == len(values["recordings"]) == 2
    assert sum(cause["folds"]) > 10.0
    assert 0.0 < cause["explained"]["in_sample"] <= 1.0
    total = (
        cause["probability"]
        + sum(cause["instead"].values())
        + sum(r["probability"] for r in cause["alternatives"])
    )
    assert total == pytest.approx(1.0, abs=0.02)
    best = values["evidence"]["before"][0]
    assert (best["cause"], best["robot"], best["joint"]) == ("sea_bias", effect["robot"], effect["joint"])
    assert values["residual"]["chi2_per_n"] < values["residual"]["chi2_per_n_tolerated"] + 0.1
    estimates = values["gain"]["estimates"]
    assert estimates["before"]["mass_kg"] != estimates["after"]["mass_kg"]
    assert estimates["before"]["mass_kg"] == pytest.approx(estimates["after"]["mass_kg"], rel=0.1)


@pytest.mark.slow
def test_the_json_has_the_form_of_any_machine(
    faulty: tuple[TeamDiagnosed, dict[str, Any]], tmp_path: Path
) -> None:
    values = faulty[0].to_dict()
    check_finite(values)
    other = verdict_to_dict(joint_verdict(tmp_path, [offset_or_spring()]))
    own = json.loads(json.dumps(values, allow_nan=False))
    assert own["machine"] == "team"
    assert list(own) == list(other)
    mine, theirs = own["causes"][0], other["causes"][0]
    assert set(mine) == set(theirs)
    for key in ("members", "told", "instead", "explained"):
        assert keys_of(mine[key]) == keys_of(theirs[key])
    assert keys_of(own["residual"]) == keys_of(other["residual"])
    assert keys_of(own["detection_limits"]) == keys_of(other["detection_limits"])
    assert keys_of(own["evidence"]["before"]) == keys_of(other["evidence"]["before"])


@pytest.mark.slow
def test_the_text_is_short(faulty: tuple[TeamDiagnosed, dict[str, Any]]) -> None:
    found, truth = faulty
    text, verbose, (effect,) = str(found), found.verbose_text(), truth["effects"]
    assert max(map(len, verbose.splitlines())) <= WIDTH
    assert len(re.findall(r"[.:](?= [A-Z]|$)", first_part(text))) <= 5
    assert first_part(text).startswith(
        "EXPLAINED: one finding accounts for what the model gets wrong in the 2 trials."
    )
    assert "2 of 2 trials are likelier" in first_part(text)
    assert f"robot {effect['robot']}, joint {effect['joint']}" in text.split("\n\n")[1]
    assert "Notes" not in text
    assert "What such logs cannot decide" in verbose
    assert format_verdict(found.to_dict()) == text


@pytest.mark.slow
def test_the_folder_is_whole(faulty: tuple[TeamDiagnosed, dict[str, Any]], tmp_path: Path) -> None:
    found, asked = faulty[0], list[Path]()
    replace(found, write_extended=asked.append).write_into(tmp_path, provenance={"a": 1})
    assert asked == [tmp_path / "extended"]
    assert read_diagnosis(tmp_path).causes[0].name == "sea_bias"
    assert (tmp_path / "report.txt").read_text(encoding="utf-8") == f"{found.verbose_text()}\n"
    before, after = (
        np.concatenate([getattr(t, f"white_{w}") for t in found.verdict.traces()])
        for w in ("before", "after")
    )
    assert np.mean(after**2) < np.mean(before**2)
    assert np.mean(after**2) == pytest.approx(1.0, abs=0.2)

    def refuse(folder: Path) -> None:
        raise InputError("there is no such spring")

    again = replace(found, write_extended=refuse)
    again.write_into(tmp_path)
    assert "There is no extended model: there is no such spring." in again.to_dict()["notes"]


@pytest.mark.slow
def test_a_healthy_team_has_limits(healthy: TeamDiagnosed) -> None:
    values = healthy.to_dict()
    assert values["verdict"] == "consistent"
    assert values["causes"] == values["suspected"] == values["scatter"] == []
    assert first_part(str(healthy)).endswith("What would have been noticed is listed with --verbose.")
    limits = {
        (entry["cause"], entry["robot"], entry["joint"]): entry["parameters"]
        for entry in values["detection_limits"]
    }
    tolerances = read_tolerances(None)
    biases = [sizes["bias_Nm"] for (cause, *_), sizes in limits.items() if cause == "sea_bias"]
    assert len(biases) == 9
    assert all(size > tolerances["sea_bias"]["bias_Nm"] for size in biases)
    assert {"slosh", "tether", "payload_mass"} <= {cause for cause, *_ in limits}
    assert "push" not in {cause for cause, *_ in limits}
