"""How near a diagnosis' estimates of the payload are to the one that was simulated, as a Markdown table."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cache
from typing import Any

import numpy as np

from discrepancy.result.text_gain import ERRORS
from discrepancy.team.estimates import errors
from mocobot_sim.scene.scene import build_team
from mocobot_sim.trial.truth import GroundTruth
from sealed.backgrounds import BACKGROUNDS


def payload_rows(results: Iterable[Mapping[str, Any]]) -> list[list[str]]:
    """One row per background: sets, and of every error the median before -> after, and in how many sets it falls."""
    both: dict[str, list[tuple[dict[str, float], dict[str, float]]]] = {}
    for result in results:
        estimates = (result["verdict"].get("gain") or {}).get("estimates")
        if estimates is None:
            continue
        truth = _truth(result["set"]["payload"])
        pair = errors(estimates["before"], truth), errors(estimates["after"], truth)
        both.setdefault(result["set"]["background"], []).append(pair)
    return [[name, str(len(both[name])), *_cells(both[name])] for name in BACKGROUNDS if name in both]


def payload_header() -> list[str]:
    """Heads of the rows' columns."""
    return ["robots", "sets", *(f"{name}: median, sets in which it falls" for name in ERRORS.values())]


def _cells(pairs: list[tuple[dict[str, float], dict[str, float]]]) -> Iterable[str]:
    for key in ERRORS:
        before, after = (np.array([one[k][key] for one in pairs]) for k in (0, 1))
        yield f"{np.median(before):.2g} -> {np.median(after):.2g}, {int(np.sum(after < before))}"


@cache
def _truth(payload: str) -> dict[str, Any]:
    return GroundTruth.of(build_team(payload)).to_dict()
