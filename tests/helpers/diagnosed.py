"""A check of the diagnosis' JSON, key by key, and a small diagnosis to report on."""

from __future__ import annotations

import math
from typing import Any

import pytest

from discrepancy.result.read import VERDICTS
from discrepancy.result.remains import of_response, scatter_sentence

PLACE = {"cause", "kind", "name", "family", "robot", "joint", "place"}
RESPONSE = {f"{c}_{kind}" for c in ("phi", "theta", "tau") for kind in ("nrmse", "rms")} | {"chi2_per_n"}


def check_schema(values: dict[str, Any], *, simulated: bool = True) -> None:
    """Assert that values have exactly the documented keys and types, and no number that is not finite.

    Provenance may be there: commands add it.
    """
    assert set(values) - {"provenance"} == {
        "format", "version", "machine", "finished", "recordings", "reference", "prior_odds", "verdict", "causes",
        "places", "suspected", "scatter", "evidence", "gain", "not_simulated", "rollouts", "undecidable",
        "detection_limits", "residual", "remains", "notes",
    }  # fmt: skip
    assert (values["format"], values["version"], values["machine"]) == ("mocobot-diagnosis", 3, "team")
    assert values["verdict"] in VERDICTS
    if values["verdict"] != "unexplained":
        assert bool(values["causes"]) == (values["verdict"] in ("explained", "partly_explained"))
    for entry in (*values["causes"], *values["suspected"]):
        _check_finding(entry, named=entry in values["causes"])
    assert all(set(entry) == {"place", "robot", "joint", "nats"} for entry in values["places"])
    assert values["scatter"] or values["verdict"] != "miscalibrated"
    for entry in values["scatter"]:
        assert set(entry) == {
            "cause", "kind", "family", "sentence", "factor", "places", "spread", "tolerance", "nats", "each"
        }  # fmt: skip
        assert len(entry["each"]) <= entry["places"]
        for place in entry["each"]:
            assert set(place) == {"robot", "joint", "place", "parameters"}
            assert set(place["parameters"]) == set(entry["spread"])
        for name, size in entry["spread"].items():
            assert size == pytest.approx(entry["factor"] * entry["tolerance"][name])
    _check_gain(values["gain"], len(values["recordings"]), simulated=simulated)
    _check_evidence(values["evidence"], named=bool(values["causes"]))
    for entry in values["undecidable"]:
        assert set(entry) == {"what", "why", "remedy"}
    for entry in values["detection_limits"]:
        assert set(entry) == {"cause", "kind", "robot", "joint", "place", "parameters"}
        assert all(size is None or size > 0 for size in entry["parameters"].values())
    residual = values["residual"]
    assert set(residual) == {"chi2_per_n", "signature", "chi2_per_n_tolerated", "unlisted_nats", "nominal"}
    assert {"chi2_per_n", "sentence", "kind", "trial"} <= set(residual["signature"])
    assert all(isinstance(text, str) for text in (*values["notes"], *values["remains"]))
    check_finite(values)


def _check_finding(cause: dict[str, Any], *, named: bool) -> None:
    assert set(cause) == PLACE | {
        "at", "event", "sentence", "parameters", "members", "explained", "probability", "over_nothing", "share_left",
        "instead", "folds", "law", "shape", "separate", "told", "alternatives",
    }  # fmt: skip
    _check_place(cause)
    for parameter in cause["parameters"].values():
        assert set(parameter) == {"value", "se"}
        assert isinstance(parameter["value"], float)
        assert parameter["se"] is None or parameter["se"] > 0
    for member in cause["members"]:
        assert set(member) == {"name", "place", "joint", "parameters"}
    for entry in cause["told"]:
        assert set(entry) == {"cause", "place", "name"}
    assert cause["told"] or not named
    assert set(cause["explained"]) == {"in_sample", "held_out"}
    assert (cause["at"] is None) == (cause["event"] is None)
    assert set(cause["instead"]) == {"nothing", "unlisted"}
    others = [*cause["instead"].values(), *(rival["probability"] for rival in cause["alternatives"])]
    assert cause["probability"] + sum(others) == pytest.approx(1.0, abs=0.02)
    assert min(others) >= 0.0
    for rival in cause["alternatives"]:
        assert set(rival) == PLACE | {"probability", "evidence_gap", "chi2_per_n", "ambiguous", "separate"}
        _check_place(rival)
        assert isinstance(rival["ambiguous"], bool)


def _check_place(values: dict[str, Any]) -> None:
    for key in ("robot", "joint"):
        assert values[key] is None or (type(values[key]) is int and values[key] >= 1)
    assert isinstance(values["cause"], str)
    assert isinstance(values["family"], str)


def _check_evidence(evidence: dict[str, Any], *, named: bool) -> None:
    assert set(evidence) == {"before", "after"}
    assert (evidence["after"] is not None) == named
    for entries in (evidence["before"], evidence["after"] or []):
        for entry in entries:
            assert set(entry) == PLACE | {"at", "nats", "needed"}
            _check_place(entry)
        nats = [entry["nats"] for entry in entries]
        assert nats == sorted(nats, reverse=True)


def _check_gain(gain: dict[str, Any], trials: int, *, simulated: bool) -> None:
    assert set(gain) - {"errors"} == {
        "held_out", "units", "noise", "removed", "validated", "trials", "estimates"
    }  # fmt: skip
    for name in ("before", "after"):
        response = gain["held_out"][name]
        assert (response is not None) == simulated
        assert response is None or set(response) == RESPONSE
        estimate = gain["estimates"][name]
        assert set(estimate) == {"mass_kg", "p_1c_m", "principal_inertia_kgm2", "grasps"}
        assert {len(estimate["p_1c_m"]), len(estimate["principal_inertia_kgm2"])} == {3}
        assert set(estimate["grasps"][0]) == {"p_1i_m", "R_1i_rotvec_deg"}
    assert len(gain["trials"]) == (trials if simulated else 0)


def check_finite(values: Any) -> None:
    """No NaN and no infinity anywhere."""
    if isinstance(values, dict):
        for item in values.values():
            check_finite(item)
    elif isinstance(values, list):
        for item in values:
            check_finite(item)
    elif isinstance(values, float):
        assert math.isfinite(values)


def _limit(
    cause: str, kind: str, robot: int | None, joint: int | None, **sizes: float | None
) -> dict[str, Any]:
    place = "payload" if robot is None else f"robot {robot}, joint {joint}"
    return {"cause": cause, "kind": kind, "robot": robot, "joint": joint, "place": place, "parameters": sizes}


def scattered() -> dict[str, Any]:
    """An entry of ``scatter``, made up."""
    places = ((2, 3, -9.1e-3), (1, 1, 7.2e-3), (3, 2, 4e-3), (1, 2, -1e-3))
    values: dict[str, Any] = {
        "cause": "theta_zero", "kind": "zero of a gimbal axis", "family": "theta_zero", "factor": 52.0, "places": 9,
        "nats": None, "tolerance": {"zero_rad": 1e-4}, "spread": {"zero_rad": 5.2e-3},
        "each": [
            {"robot": r, "joint": j, "place": f"robot {r}, joint {j}",
             "parameters": {"zero_rad": {"value": value, "se": 2e-4}}}
            for r, j, value in places
        ],
    }  # fmt: skip
    return values | {"sentence": scatter_sentence(values)}


def small_diagnosis(verdict: str = "explained") -> dict[str, Any]:
    """A diagnosis as ``TeamDiagnosed.to_dict`` gives it, made up."""
    place = {
        "cause": "sea_bias",
        "kind": "torque zero of a driven joint",
        "name": "torque zero of joint 1 of robot 2",
        "family": "sea_torque",
        "robot": 2,
        "joint": 1,
        "place": "robot 2, joint 1",
    }
    rival = {
        "cause": "sea_scale",
        "kind": "spring stiffness of a driven joint",
        "name": "spring stiffness of joint 1 of robot 2",
        "family": "sea_torque",
        "robot": 2,
        "joint": 1,
        "place": "robot 2, joint 1",
    }
    cause: dict[str, Any] = {
        **place,
        "sentence": "Robot 2, joint 1: the torque sensor reads 0.0500 +- 0.0010 N m too much.",
        "parameters": {"bias_Nm": {"value": 0.05, "se": 0.001}},
        "explained": {"in_sample": 0.99, "held_out": 0.98},
        "probability": 0.8,
        "over_nothing": 180.0,
        "share_left": None,
        "instead": {"nothing": 0.0, "unlisted": 0.1},
        "folds": [3.0, 4.0],
        "shape": {},
        "separate": "A known weight separates them.",
        "law": None,
        "at": None,
        "event": None,
        "told": [{key: entry[key] for key in ("cause", "place", "name")} for entry in (place, rival)],
        "alternatives": [
            {**rival, "probability": 0.1, "evidence_gap": 2.0, "chi2_per_n": None, "ambiguous": True, "separate": ""}
        ],
    }  # fmt: skip
    own = {"name": place["name"], "place": place["place"], "joint": 1, "parameters": cause["parameters"]}
    cause["members"] = [own]
    before = dict.fromkeys(sorted(RESPONSE), 0.01) | {"chi2_per_n": 90.0}
    after = dict.fromkeys(sorted(RESPONSE), 0.001) | {"chi2_per_n": 1.01}
    estimate = {
        "mass_kg": 11.7, "p_1c_m": [0.1, 0.2, 0.3], "principal_inertia_kgm2": [1.0, 2.0, 3.0],
        "grasps": [{"p_1i_m": [0.0, 0.0, 0.0], "R_1i_rotvec_deg": [0.0, 0.0, 0.0]}] * 2,
    }  # fmt: skip
    signature = {"chi2_per_n": 1.1, "sentence": "somewhere.", "kind": {}, "trial": {}}
    trial = {"before": before, "after": after}
    values = {
        "format": "mocobot-diagnosis",
        "version": 3,
        "machine": "team",
        "finished": True,
        "recordings": ["one", "two"],
        "reference": [],
        "verdict": verdict,
        "causes": [cause] if "explained" in verdict and verdict != "unexplained" else [],
        "evidence": {
            "before": [
                {**place, "at": None, "nats": 180.0, "needed": 7.0},
                {**rival, "at": None, "nats": 150.0, "needed": 7.0},
                {
                    "cause": "push",
                    "kind": "push on the payload",
                    "name": "push on the payload",
                    "family": "push",
                    "robot": None,
                    "joint": None,
                    "place": "payload",
                    "at": None,
                    "nats": 1.4,
                    "needed": 7.0,
                },
            ],
            "after": None
            if "explained" not in verdict or verdict == "unexplained"
            else [{**rival, "at": None, "nats": 0.2, "needed": 7.0}],
        },
        "places": [],
        "prior_odds": None,
        "suspected": [],
        "scatter": [scattered()] if verdict == "miscalibrated" else [],
        "gain": {
            "held_out": {"before": before, "after": after, "as_found": None},
            "units": {"phi": "rad", "theta": "rad", "tau": "N m"},
            "noise": {"phi_rms": 1e-4, "theta_rms": 1e-4, "tau_rms": 1e-3},
            "removed": {"share": 0.99, "interval": [0.9, 1.0]},
            "validated": True,
            "trials": [{"name": "one", **trial}, {"name": "two", **trial}],
            "estimates": {"before": estimate, "after": estimate},
        },
        "not_simulated": None,
        "rollouts": None,
        "undecidable": [{"what": "this", "why": "of that", "remedy": "a weight"}],
        "detection_limits": [
            _limit("sea_bias", "torque zero of a driven joint", 1, 1, bias_Nm=0.0213),
            _limit("sea_bias", "torque zero of a driven joint", 1, 2, bias_Nm=0.0189),
            _limit("phi_zero", "encoder zero of a driven joint", 1, 1, zero_rad=4e-5),
            _limit("theta_zero", "encoder zero of a gimbal axis", 1, 1, zero_rad=6e-4),
            _limit("theta_zero", "encoder zero of a gimbal axis", 1, 3, zero_rad=None),
            _limit("slosh", "mass that swings in the payload", None, None, mass_kg=None),
        ],
        "residual": {
            "chi2_per_n": 1.1,
            "signature": signature,
            "chi2_per_n_tolerated": 1.4,
            "unlisted_nats": None,
            "nominal": {"chi2_per_n": 12.0, "signature": signature},
        },
        "notes": ["A note."],
    }
    values["remains"] = of_response(values)
    check_schema(values)
    return values
