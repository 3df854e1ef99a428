"""Hold a result against its truth.

What is hidden counts as right where its cause is named at its place, or is in the told set of what is named: the causes
that hold 90 % together, unless something that no table lists is among them. What no table lists counts as right where
it is located: ``unlisted`` at its place, as a function of its signal. A cause that was left out counts as right where
something is told as unlisted, or the verdict stays open.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from discrepancy.team.causes import CAUSES
from mocobot.campaign.summary import Score, family_of, match
from scoring import SURE
from sealed.grounded import of_the_background

__all__ = ["HEALTHY", "Score", "Scored", "family_of", "score"]

Item = Mapping[str, Any]
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
        listed = sum(one.right for one in self.scores) + sum(bool(one["which"]) for one in self.laws)
        open_ = self.verdict in ("unexplained", "partly_explained") or "unlisted" in self._named
        return listed + (sum(map(_is_nobodys, self.scores)) if open_ else 0)

    @property
    def _named(self) -> set[str]:
        return {cause["cause"] for cause in self.result["verdict"]["causes"]}

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
    excluded = set(set_["names"]) if set_["kind"] == "left-out" else set()
    causes = [_as_told(cause) for cause in result["verdict"]["causes"] if cause["cause"] != "unlisted"]
    unlisted = [cause for cause in result["verdict"]["causes"] if cause["cause"] == "unlisted"]
    grounded = [c for c in causes if not _hidden(c, truth) and of_the_background(c, truth)]
    found = match(
        [c for c in causes if c not in grounded], truth, _factors(set_, truth["effects"]),
        lambda cause: cause in CAUSES and cause not in excluded,
    )  # fmt: skip
    located = {k for law in result["law_scores"] for k in law["which"]}
    loose = any(map(_is_nobodys, found.scores))
    told = [(c, loose or k in located) for k, c in enumerate(unlisted)]
    strangers = [c for c, right in told if not right]
    more = [(c, True) for c in grounded] + told
    there = [(float(c["probability"]), right) for c, right in more if c.get("probability") is not None]
    return Scored(
        result, found.scores, found.extras, tuple(grounded), tuple(strangers), (*found.stated, *there)
    )


def _is_nobodys(one: Score) -> bool:
    """Whether it is a cause that was left out: it may be told as unlisted wherever it shows."""
    return not one.listed and not one.effect.get("law")


def _as_told(cause: Item) -> Item:
    """A cause whose told set names none if something unlisted is in it."""
    if all(one["cause"] != "unlisted" for one in cause.get("told", ())):
        return cause
    return {**cause, "alternatives": [{**rival, "ambiguous": False} for rival in cause["alternatives"]]}


def _hidden(item: Item, truth: Item) -> bool:
    """Whether it is the right cause for something hidden, at a place that is right for it."""
    each = (match([item], {**truth, "effects": [effect]}, [1.0]).scores[0] for effect in truth["effects"])
    return any(one.member and one.place for one in each)


def _factors(request: Item, effects: Sequence[Item]) -> list[float]:
    if len(request["factors"]) == len(effects):
        return list(request["factors"])
    return [request["factors"][0]] * len(effects)  # pushes: one factor for all
