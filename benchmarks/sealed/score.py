"""Hold a result against its truth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from discrepancy.team.causes import CAUSES
from mocobot.campaign.score import Score, family_of, match

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
        extras: what was named besides.
        stated: probability and rightness of everything that was named with a probability, laws left out.
    """

    result: Item
    scores: tuple[Score, ...]
    extras: tuple[Item, ...]
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
            return self.verdict in HEALTHY
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
    found = match(
        causes, truth, _factors(result["set"], truth["effects"]),
        lambda cause: cause in CAUSES and cause not in excluded,
    )  # fmt: skip
    return Scored(result, found.scores, found.extras, found.stated)


def _factors(request: Item, effects: Sequence[Item]) -> list[float]:
    if len(request["factors"]) == len(effects):
        return list(request["factors"])
    return [request["factors"][0]] * len(effects)  # pushes: one factor for all
