"""What a verdict is worth: against what was hidden, what the background drew, and the laws as they are."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from discrepancy.team.causes import CAUSES, default_tolerances
from mocobot.campaign.effects import one_axis
from mocobot.campaign.summary import Score, match
from scoring import SURE

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


@dataclass(frozen=True)
class LawScore:
    """How well an unlisted effect was told.

    Attributes:
        which: of the verdict's unlisted ones, from 0, those that are located: a vector has one for each axis.
        place, variable, formula: whether these are right.
    """

    which: tuple[int, ...] = ()
    place: bool = False
    variable: bool = False
    formula: bool = False


def score_laws(result: Item) -> list[LawScore]:
    """For every unlisted effect of a result what comes nearest to it of that which is told as unlisted."""
    told = [cause for cause in result["verdict"]["causes"] if cause["cause"] == "unlisted"]
    out: list[LawScore] = []
    for effect in result["truth"]["effects"]:
        if not effect.get("law"):
            continue
        taken = {k for one in out for k in one.which}
        each = [_score(k, c, effect, result["truth"]) for k, c in enumerate(told) if k not in taken]
        best = max(each, key=lambda one: (one.place, one.variable, one.formula), default=LawScore())
        out.append(replace(best, which=tuple(k for one in each for k in one.which)))
    return out


def _score(which: int, cause: Item, effect: Item, truth: Item) -> LawScore:
    place = _place(cause, effect, truth)
    variable, law = place and _variable(cause, effect), cause["law"]
    named = bool(place and law) and law["function"] in FORMULAS.get(effect["cause"], ())
    return LawScore((which,) if variable else (), place, variable, named and _inside(law["numbers"], effect))


HELD = {
    "dropouts_phi": "driven joint {joint} of robot {robot}",
    "dropouts_theta": "gimbal axis {joint} of robot {robot}",
}
"""Places of encoders that hold their last value: events without a law."""
PLACES: dict[str, tuple[str, ...]] = {
    "tau reading": ("reading of the torque sensor of driven joint {joint} of robot {robot}",),
    "phi reading": ("reading of the angle of driven joint {joint} of robot {robot}",),
    "theta reading": ("reading of the angle of gimbal axis {joint} of robot {robot}",),
    "torque in driven joint": (  # the rows are the same
        "torque in driven joint {joint} of robot {robot}",
        "reading of the torque sensor of driven joint {joint} of robot {robot}",
    ),
    "torque in gimbal axis": ("torque in gimbal axis {joint} of robot {robot}",),
    "force on the payload, in the world": ("force and moment on the payload",),
    "moment on the payload": ("angular momentum inside the payload", "force and moment on the payload"),
    "displacement of the base, down": (
        "displacement of base of robot {robot}", "displacement of grasp of robot {robot}"
    ),
}  # fmt: skip
"""Words of a verdict's place, by what the truth calls it."""
FORMULAS: dict[str, tuple[str, ...]] = {
    "cross_talk": ("linear",), "warming_scale": ("warming",), "warming_zero": ("warming",),
    "saturation": ("above", "beyond"), "quadratic_reading": ("square",), "angle_in_torque": ("sine",),
    "torque_hum": ("hum",), "eccentric_phi": ("sine",), "eccentric_theta": ("sine",),
    "cyclic_phi": ("sine",), "encoder_backlash": ("play",),
    "cogging": ("sine",), "cubic_spring": ("cube",), "cable_spring": ("linear",),
    "growing_push": ("linear",), "gyroscope": ("constant",),
    "sinking_base": ("warming",),
}  # fmt: skip
"""Functions of the dictionary that are the hidden formula."""
PERIODS: dict[str, float] = {"eccentric_phi": 1.0, "eccentric_theta": 1.0, "cyclic_phi": 16.0}
VARIABLES: dict[str, tuple[set[str], ...]] = {
    "warming_scale": ({"time", "tau"},), "warming_zero": ({"time"},), "saturation": ({"tau"},),
    "quadratic_reading": ({"tau"},), "angle_in_torque": ({"phi"},),
    "torque_hum": ({"time"},), "eccentric_phi": ({"phi"},), "eccentric_theta": ({"theta"},), "cyclic_phi": ({"phi"},),
    "encoder_backlash": ({"phi"},),
    "cogging": ({"phi"},), "cubic_spring": ({"theta"},), "cable_spring": ({"theta"},),
    "growing_push": ({"time"},), "gyroscope": ({"time"},), "sinking_base": ({"time"},),
}  # fmt: skip
"""Signals of the hidden formula, of its own joint."""


def _inside(numbers: Item, effect: Item) -> bool:
    """Whether the periods, frequency or time inside a function are right, too: within a tenth."""
    p = effect["parameters"]
    true = {
        "times": PERIODS.get(effect["cause"], p.get("times")),
        "frequency_hz": p.get("frequency_hz"),
        "time_s": p.get("time_s"),
    }
    near = {
        "times": 0.1,
        "frequency_hz": 0.01,
        "time_s": 0.25,
    }
    return all(
        true[name] is None or abs(numbers[name] / true[name] - 1.0) < near[name]
        for name in true
        if name in numbers
    )


def _place(cause: Item, effect: Item, truth: Item) -> bool:
    here, words = effect["law"]["place"], PLACES.get(effect["law"]["of"], ())
    places = [here]
    if effect["law"]["of"] == "torque in gimbal axis":  # parallel axes cannot be told apart
        every = ({"robot": i + 1, "joint": j} for i in range(len(truth["gimbal_axes_1"])) for j in (1, 2, 3))
        places = [other for other in every if one_axis(truth["gimbal_axes_1"], other, here)]
    names = [word.format(robot=one.get("robot"), joint=one.get("joint")) for word in words for one in places]
    if effect["cause"] in HELD:
        names.append(HELD[effect["cause"]].format(**here))
    return any(cause["place"].startswith(name) for name in names)


def _variable(cause: Item, effect: Item) -> bool:
    """Whether it is a function of the signals of the truth; those of a parallel axis are the same."""
    law = cause["law"] or {}
    found = {name for name in (law.get("of") or signal_of(cause), law.get("times")) if name}
    joint = re.search(r"(\d+) of robot (\d+)", cause["place"])
    own = {name.removesuffix(f"_{joint[2]}_{joint[1]}") if joint else name for name in found}
    if effect["cause"] == "cross_talk":
        return found == {f"tau_{effect['law']['place']['robot']}_{int(effect['parameters']['neighbour'])}"}
    return own in VARIABLES.get(effect["cause"], (own,))  # of an event any


def signal_of(cause: Item) -> str:
    """Signal of something located without a formula, as its kind says: ``... by its SIGNAL``."""
    return cause["kind"].partition(" by its ")[2]


HEALTHY = ("consistent", "miscalibrated")
"""Verdicts that name no fault."""


@dataclass(frozen=True)
class Scored:
    """A whole result.

    Attributes:
        result: what was scored.
        scores: one for every hidden effect.
        extras: listed causes that were named besides and are not there.
        grounded: those that were named besides and are there, because the background drew them (``grounded``).
        strangers: what is named as unlisted and is not located right.
        stated: probability and rightness of everything that was named.
    """

    result: Item
    scores: tuple[Score, ...]
    extras: tuple[Item, ...]
    grounded: tuple[Item, ...]
    strangers: tuple[Item, ...]
    stated: tuple[tuple[float, bool], ...]

    @property
    def verdict(self) -> str:
        """The verdict's first word."""
        return self.result["verdict"]["verdict"]

    @property
    def laws(self) -> Sequence[Item]:
        """How well each unlisted effect was told (``law_score.LawScore``)."""
        return self.result["law_scores"]

    @property
    def right(self) -> int:
        """How many of the hidden effects are told right."""
        return sum(one.right for one in self.scores) + sum(bool(one["which"]) for one in self.laws)

    @property
    def certain(self) -> int:
        """How much was named with certainty and is not there."""
        return sum(p >= SURE and not right for p, right in self.stated)

    @property
    def whole(self) -> bool:
        """Whether everything hidden was told right, and nothing was named that is not there."""
        if self.extras or self.strangers:
            return False
        if not self.scores:
            return self.verdict in HEALTHY or (self.verdict == "explained" and bool(self.grounded))
        return self.right == len(self.scores)


def score(result: Item) -> Scored:
    """Score one result that ended without an error."""
    truth, set_ = result["truth"], result["set"]
    causes = [_as_told(cause) for cause in result["verdict"]["causes"] if cause["cause"] != "unlisted"]
    unlisted = [cause for cause in result["verdict"]["causes"] if cause["cause"] == "unlisted"]
    grounded = [c for c in causes if not _hidden(c, truth) and of_the_background(c, truth)]
    found = match(
        [c for c in causes if c not in grounded], truth, set_["factors"], lambda cause: cause in CAUSES
    )
    located = {k for law in result["law_scores"] for k in law["which"]}
    told = [(c, k in located) for k, c in enumerate(unlisted)]
    strangers = [c for c, right in told if not right]
    more = [(c, True) for c in grounded] + told
    there = [(float(c["probability"]), right) for c, right in more if c.get("probability") is not None]
    return Scored(
        result, found.scores, found.extras, tuple(grounded), tuple(strangers), (*found.stated, *there)
    )


def _as_told(cause: Item) -> Item:
    """A cause whose told set names none if something unlisted is in it."""
    if all(one["cause"] != "unlisted" for one in cause.get("told", ())):
        return cause
    return {**cause, "alternatives": [{**rival, "ambiguous": False} for rival in cause["alternatives"]]}


def _hidden(item: Item, truth: Item) -> bool:
    """Whether it is the right cause for something hidden, at a place that is right for it."""
    each = (match([item], {**truth, "effects": [effect]}, [1.0]).scores[0] for effect in truth["effects"])
    return any(one.member and one.place for one in each)
