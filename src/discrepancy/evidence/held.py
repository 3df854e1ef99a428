"""Encoders that hold their last value for a while, told as findings beside a verdict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

from discrepancy.evidence.findings import Event, Finding, Verdict

V = TypeVar("V", bound=Verdict)
KIND = "held readings"


@dataclass(frozen=True)
class HeldReadings:
    """What one encoder does.

    Attributes:
        place, joint: of which joint, from 1.
        of: what it reads, in words, with its place.
        events: every time that it holds its value, the first one first.
        share: of the time of all trials.
        nats: by how much that is likelier than a joint that moves so.
    """

    place: str
    joint: int
    of: str
    events: Sequence[Event]
    share: float
    nats: float

    @property
    def finding(self) -> Finding:
        """As a finding."""
        return Finding(
            cause="unlisted", place=self.place, joint=self.joint, members=(), probability=1.0, nothing=0.0,
            unlisted=1.0, over_nothing=self.nats, event=self.events[0],
            shape={"held": float(len(self.events)), "share": self.share},
        )  # fmt: skip

    @property
    def note(self) -> str:
        """A sentence on how often, how long and when."""
        lengths = [1e3 * event.duration_s for event in self.events]
        first = self.events[0]
        return (
            f"The encoder of {self.of} holds its last value {len(lengths)} times, for {min(lengths):.0f} to "
            f"{max(lengths):.0f} ms, in all {100.0 * self.share:.1f} % of the time, first from "
            f"{first.start_s:.2f} s of trial {first.trial + 1}. Rows that it "
            "reaches are left out."
        )


def with_held(verdict: V, held: Sequence[HeldReadings]) -> V:
    """The verdict with a finding and a note for every encoder that holds its value.

    Rows that held readings reach are none of the verdict's, so that what else it finds is not due to them.
    """
    if not held:
        return verdict
    word = "explained" if verdict.verdict in ("consistent", "miscalibrated") else verdict.verdict
    findings, notes = (
        (*verdict.findings, *(h.finding for h in held)),
        (*verdict.notes, *(h.note for h in held)),
    )
    return replace(verdict, verdict=word, findings=findings, notes=notes)


def words_of(finding: Finding, place: str) -> dict[str, Any]:
    """What such a finding is, at its place in words; of any other, nothing."""
    if "held" not in finding.shape:
        return {}
    times, share = finding.shape["held"], 100.0 * finding.shape["share"]
    sentence = f"{place}: the encoder holds its last value {times:.0f} times, for {share:.1f} % of the time."
    return {"kind": KIND, "name": f"{KIND} at {place}", "place": place, "sentence": sentence}
