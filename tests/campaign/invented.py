"""Results of sets as if they had been simulated and diagnosed."""

from __future__ import annotations

from typing import Any

from discrepancy.team.causes import CAUSES
from mocobot.campaign.run import CampaignPlan, CampaignSet

Json = dict[str, Any]
LIMITS = {
    "places": [
        {"cause": "sea_bias", "kind": "k", "robot": 1, "joint": 1, "parameters": {"bias_Nm": 0.02}},
        {"cause": "sea_bias", "kind": "k", "robot": 1, "joint": 2, "parameters": {"bias_Nm": 0.04}},
        {"cause": "sea_bias", "kind": "k", "robot": 2, "joint": 1, "parameters": {"bias_Nm": None}},
        {"cause": "drag", "kind": "k", "robot": None, "joint": None, "parameters": {"coefficient_Ns_per_m": 0.3}},
    ],
    "pushes": [{"trial": 1, "parameters": {"force_x_N": 0.1, "force_y_N": 0.2, "force_z_N": None}}],
}  # fmt: skip


def named(cause: str, robot: int | None, joint: int | None, probability: float, **values: Any) -> Json:
    """An entry of a diagnosis' causes; values are pairs of estimate and standard error."""
    parameters = {name: {"value": value, "se": se} for name, (value, se) in values.items()}
    return {
        "cause": cause, "family": CAUSES[cause].family, "robot": robot, "joint": joint, "parameters": parameters,
        "alternatives": [], "probability": probability,
    }  # fmt: skip


def result(one: CampaignSet, causes: list[Json], verdict: str = "explained") -> Json:
    """Of a set; what is hidden is a torque zero of 0.08 N m in joint 1 of robot 1, or a drag of 1.2 N s/m."""
    hidden: Json = {"cause": one.cause, "parameters": {"coefficient_Ns_per_m": 1.2}}
    if one.cause == "sea_bias":
        hidden |= {"robot": 1, "joint": 1, "parameters": {"bias_Nm": 0.08}}
    answer = {key: hidden.get(key) for key in ("cause", "robot", "joint")} | {"known": hidden["parameters"]}
    effects = [] if one.cause is None else [hidden | {"answer": answer}]
    out: Json = {
        "set": one.to_dict(), "error": None, "unexpected": False,
        "truth": {"effects": effects, "units": [], "gimbal_axes_1": []},
        "verdict": {"verdict": verdict, "causes": causes, "suspected": [], "scatter": [], "residual": {}, "notes": []},
    }  # fmt: skip
    return out | ({"limits": LIMITS} if one.cause is None else {})


def quiet(task: tuple[CampaignPlan, CampaignSet, Json | None]) -> Json:
    """A diagnosis that never names anything."""
    return result(task[1], [], "consistent")
