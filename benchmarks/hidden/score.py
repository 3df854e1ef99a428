"""Hold a verdict against the truth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from discrepancy import rules
from discrepancy.team.causes import CAUSES
from hidden.limits import LIMITS
from mocobot.campaign.ground import one_axis
from mocobot_sim.scene.models import omnid_design

Array = NDArray[np.float64]

Item = Mapping[str, Any]


@dataclass(frozen=True)
class Score:
    """How well one hidden effect was found.

    Attributes:
        named: cause that the verdict names for it, or None.
        family, member: whether family and cause are right.
        ambiguous: the wrong member, but the right one, at its place, is among those that the verdict calls ambiguous.
        place: whether the place is right; False where the cause is wrong.
        error: parameters, estimate minus truth over truth (norms in units of the detection limits); None where the
            cause or its place is wrong.
        deviations: estimate minus truth over the standard error of every parameter that has one; empty where the
            cause or its place is wrong.
    """

    named: str | None
    family: bool
    member: bool
    ambiguous: bool
    place: bool
    error: float | None
    deviations: tuple[float, ...] = ()


def score(verdict: Mapping[str, Any], truth: Mapping[str, Any]) -> tuple[list[Score], list[str]]:
    """One score per hidden effect, and the causes that were named besides."""
    left = list(verdict["found"])
    scores = []
    for effect in truth["effects"]:
        match = _match(left, effect, truth)
        if match is not None:
            left.remove(match)
        scores.append(_score(match, effect, truth))
    return scores, [item["cause"] for item in left]


def _match(found: Sequence[Item], effect: Item, truth: Item) -> Item | None:
    """The named cause that comes nearest to a hidden one: place, then member, then family, then any."""
    if not found:
        return None

    def rank(item: Item) -> tuple[bool, bool, bool]:
        member = item["cause"] == effect["cause"]
        return member and _same_place(item, effect, truth), member, _family(item) == _family(effect)

    best = max(found, key=rank)
    # With several hidden effects, a stranger belongs to none of them.
    return best if any(rank(best)) or len(truth["effects"]) == 1 else None


def _score(item: Item | None, effect: Item, truth: Item) -> Score:
    if item is None:
        return Score(None, False, False, False, False, None)
    member = item["cause"] == effect["cause"]
    beside = [rival for rival in item["rivals"] if rival.get("ambiguous")]
    ambiguous = not member and any(
        rival["cause"] == effect["cause"] and _here(rival) == _here(effect) for rival in beside
    )
    place = ambiguous or (member and _same_place(item, effect, truth))
    right = member and place
    error = _error(item, effect) if right else None
    family = _family(item) == _family(effect)
    return Score(
        item["cause"], family, member, ambiguous, place, error, _deviations(item, effect) if right else ()
    )


def _family(item: Item) -> str | None:
    """Of a cause; a law has none."""
    return CAUSES[item["cause"]].family if item["cause"] in CAUSES else None


def _same_place(item: Item, effect: Item, truth: Item) -> bool:
    if item["cause"] == effect["cause"] == "gimbal_friction":
        return one_axis(truth["gimbal_axes_1"], item, effect)
    if effect["cause"] == "push":
        p, q = item["parameters"], effect["parameters"]
        overlap = min(p["start_s"] + p["duration_s"], q["start_s"] + q["duration_s"]) - max(
            p["start_s"], q["start_s"]
        )
        return p["trial"] == q["trial"] and overlap > 0
    return _here(item) == _here(effect)


def _here(item: Item) -> tuple[int | None, int | None]:
    return item.get("robot"), item.get("joint")


def _error(item: Item, effect: Item) -> float:
    estimate, true = (_vector(effect["cause"], x["parameters"]) for x in (item, effect))
    return float(np.linalg.norm(estimate - true) / np.linalg.norm(true))


def _deviations(item: Item, effect: Item) -> tuple[float, ...]:
    """Of every parameter with a standard error; where a push acts along its line cannot be told."""
    out = []
    for name, se in item.get("standard_errors", {}).items():
        told = name in effect["parameters"] and not (effect["cause"] == "push" and name.startswith("point"))
        if told and np.isfinite(se) and se > 0:
            out.append((item["parameters"][name] - effect["parameters"][name]) / se)
    return tuple(out)


def _vector(cause: str, parameters: Mapping[str, float]) -> Array:
    """Parameters that count, each in units of its detection limit; a tether's as force at home and stiffness."""
    values = dict(parameters)
    if cause in ("tether", "payload_tether"):
        home = (0.0, 0.0, omnid_design().home_height_m)
        for axis, at in zip("xyz", home, strict=True):
            arm = values[f"anchor_{axis}_m"] - at - values.get(f"point_{axis}_m", 0.0)
            values[f"force_{axis}_N"] = values["stiffness_N_per_m"] * arm
    if cause == "payload_mass":  # of a drift, in a minute
        values["mass_kg"] += rules.MASS_OVER_S * values["rate_kgps"]
    return np.array([values.get(name, 0.0) / limit for name, limit in LIMITS[cause].items()])
