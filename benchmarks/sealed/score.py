"""Hold a result against its truth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from discrepancy.team.causes import CAUSES
from mocobot.campaign.summary import Score, family_of, match
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
        extras: what was named besides and is not there.
        grounded: what was named besides and is there, because the background drew it (``grounded``).
        stated: probability and rightness of everything that was named with a probability, laws left out.
    """

    result: Item
    scores: tuple[Score, ...]
    extras: tuple[Item, ...]
    grounded: tuple[Item, ...]
    stated: tuple[tuple[float, bool], ...]

    @property
    def verdict(self) -> str:
        """The verdict's first word."""
        return self.result["verdict"]["verdict"]

    @property
    def laws(self) -> tuple[Item, ...]:
        """Laws that were stated."""
        return tuple(cause for cause in self.result["verdict"]["causes"] if cause["cause"] == "law")

    @property
    def whole(self) -> bool:
        """Whether everything hidden was named right, or left unexplained if nobody lists it, and nothing else was."""
        if self.extras or (self.laws and all(score.listed for score in self.scores)):
            return False
        if not self.scores:
            return self.verdict in HEALTHY or (self.verdict == "explained" and bool(self.grounded))
        listed = [score for score in self.scores if score.listed]
        return all(score.right for score in listed) and (
            len(listed) == len(self.scores)
            or self.verdict in ("unexplained", "partly_explained")
            or bool(self.laws)
        )


def score(result: Item) -> Scored:
    """Score one result that ended without an error."""
    truth = result["truth"]
    excluded = set(result["set"]["names"]) if result["set"]["kind"] == "left-out" else set()
    causes = [cause for cause in result["verdict"]["causes"] if cause["cause"] != "law"]
    grounded = [c for c in causes if not _hidden(c, truth) and of_the_background(c, truth)]
    found = match(
        [c for c in causes if c not in grounded], truth, _factors(result["set"], truth["effects"]),
        lambda cause: cause in CAUSES and cause not in excluded,
    )  # fmt: skip
    there = [(float(c["probability"]), True) for c in grounded if c.get("probability") is not None]
    return Scored(result, found.scores, found.extras, tuple(grounded), (*found.stated, *there))


def _hidden(item: Item, truth: Item) -> bool:
    """Whether it is the right cause for something hidden, at a place that is right for it."""
    each = (match([item], {**truth, "effects": [effect]}, [1.0]).scores[0] for effect in truth["effects"])
    return any(one.member and one.place for one in each)


def _factors(request: Item, effects: Sequence[Item]) -> list[float]:
    if len(request["factors"]) == len(effects):
        return list(request["factors"])
    return [request["factors"][0]] * len(effects)  # pushes: one factor for all
