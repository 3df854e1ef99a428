"""Causes that a diagnosis names and nobody hid, but that are there: what a wide background drew at that place."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from discrepancy.team.causes import default_tolerances
from mocobot.campaign.summary import match

Item = Mapping[str, Any]
LARGE = 4.0
"""Tolerances that a drawn size must exceed to be a fault of its own: a robot within four of them needs no repair."""
NEAR, NEAR_SE = 0.25, 3.0
"""Share or standard errors by which a named size may be off the drawn one."""


def of_the_background(item: Item, truth: Item) -> bool:
    """Whether a named cause is what the background drew there, larger than any tolerance, at its true size.

    At ten times the tolerances one place in three has more of a kind than four tolerances: whoever names it is right.
    """
    return any(_is(item, effect, truth) for effect in truth["background"] if effect["cause"] == item["cause"])


def _is(item: Item, effect: Item, truth: Item) -> bool:
    tolerances = default_tolerances()[effect["cause"]]
    known = {name: value for name, value in effect["parameters"].items() if name in tolerances}
    large = {name for name, value in known.items() if abs(value) > LARGE * tolerances[name]}
    if not large:
        return False
    answer = {"cause": effect["cause"], "robot": effect.get("robot"), "joint": effect.get("joint")}
    as_hidden = {**effect, "answer": {**answer, "known": {name: known[name] for name in large}}}
    (score,) = match([item], {**truth, "effects": [as_hidden]}, [1.0]).scores
    near = score.error is not None and score.error < NEAR
    within = bool(score.deviations) and float(np.max(np.abs(score.deviations))) < NEAR_SE
    return score.right and (near or within)
