"""What a team's verdict on the small engine tells: causes with sizes and probabilities, JSON, text, folder."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from diagnosed import check_finite
from discrepancy.joints.diagnosed import verdict_to_dict
from discrepancy.result.read import read_diagnosis
from discrepancy.result.report import format_verdict
from discrepancy.team import told
from discrepancy.team.causes import read_tolerances
from discrepancy.team.diagnosis import diagnose_team
from discrepancy.team.told import TeamDiagnosed
from estimator.errors import InputError
from hidden_team import recorded
from joint_verdicts import joint_verdict, offset_or_spring
from mocobot_sim.effects import make_effect
from mocobot_sim.extended.extended import load_extended

WIDTH = 100
ROBOT, JOINT, BIAS_NM = 3, 2, 0.12


@pytest.fixture(scope="module")
def faulty() -> TeamDiagnosed:
    """Of a torque's zero that is off."""
    return diagnose_team(recorded("b", [make_effect("sea_bias", {"bias_Nm": BIAS_NM}, ROBOT, JOINT)], seed=2),
                         closed_loop=False)  # fmt: skip


@pytest.fixture(scope="module")
def healthy() -> TeamDiagnosed:
    return diagnose_team(recorded("a", seed=11), closed_loop=False)


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
def test_a_hidden_cause_is_named_with_its_size(faulty: TeamDiagnosed) -> None:
    values = faulty.to_dict()
    (cause,) = values["causes"]
    assert values["verdict"] == "explained"
    assert (cause["cause"], cause["robot"], cause["joint"]) == ("sea_bias", ROBOT, JOINT)
    size = cause["parameters"]["bias_Nm"]
    assert size["value"] == pytest.approx(BIAS_NM, abs=4.0 * size["se"])
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
    assert (best["cause"], best["robot"], best["joint"]) == ("sea_bias", ROBOT, JOINT)
    assert values["residual"]["chi2_per_n"] < values["residual"]["chi2_per_n_tolerated"] + 0.1
    estimates = values["gain"]["estimates"]
    assert estimates["before"]["mass_kg"] != estimates["after"]["mass_kg"]
    assert estimates["before"]["mass_kg"] == pytest.approx(estimates["after"]["mass_kg"], rel=0.1)


@pytest.mark.slow
def test_the_json_has_the_form_of_any_machine(faulty: TeamDiagnosed, tmp_path: Path) -> None:
    values = faulty.to_dict()
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
def test_the_text_is_short(faulty: TeamDiagnosed) -> None:
    text, verbose = str(faulty), faulty.verbose_text()
    assert max(map(len, verbose.splitlines())) <= WIDTH
    assert len(re.findall(r"[.:](?= [A-Z]|$)", first_part(text))) <= 5
    assert first_part(text).startswith(
        "EXPLAINED: one finding accounts for what the model gets wrong in the 2 trials."
    )
    assert "2 of 2 trials are likelier" in first_part(text)
    assert f"robot {ROBOT}, joint {JOINT}" in text.split("\n\n")[1]
    assert "Notes" not in text
    assert faulty.to_dict()["residual"]["signature"]["sentence"]
    assert "What such logs cannot decide" in verbose
    assert format_verdict(faulty.to_dict()) == text


@pytest.mark.slow
def test_the_folder_is_whole(faulty: TeamDiagnosed, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found = faulty
    found.write_into(tmp_path, provenance={"a": 1})
    off_Nm = load_extended(tmp_path / "extended").units[ROBOT - 1].tau_zero_Nm[JOINT - 1]
    assert off_Nm == pytest.approx(BIAS_NM, rel=0.1)
    assert not (tmp_path / "as_found").exists()
    assert read_diagnosis(tmp_path).causes[0].name == "sea_bias"
    assert (tmp_path / "report.txt").read_text(encoding="utf-8") == f"{found.verbose_text()}\n"
    before, after = (
        np.concatenate([getattr(t, f"white_{w}") for t in found.verdict.traces()])
        for w in ("before", "after")
    )
    assert np.mean(after**2) < np.mean(before**2)
    assert np.mean(after**2) == pytest.approx(1.0, abs=0.2)

    def refuse(*_: object, **__: object) -> None:
        raise InputError("there is no such spring")

    monkeypatch.setattr(told, "write_model", refuse)
    found.write_into(tmp_path)
    found.write_into(tmp_path)
    assert found.to_dict()["notes"].count("There is no extended model: there is no such spring.") == 1


@pytest.mark.slow
def test_a_healthy_team_has_limits(healthy: TeamDiagnosed) -> None:
    values = healthy.to_dict()
    assert values["verdict"] == "consistent"
    assert values["causes"] == values["suspected"] == values["scatter"] == []
    assert values["residual"]["chi2_per_n"] < 1.2
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
