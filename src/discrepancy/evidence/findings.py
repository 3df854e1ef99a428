"""What a search found, place by place, in physical values, and encoders that hold their last value."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Literal, TypeVar

if TYPE_CHECKING:
    from discrepancy.formulas.law import Law
    from discrepancy.result.traces import Trace

Word = Literal["consistent", "miscalibrated", "explained", "partly_explained", "unexplained"]


@dataclass(frozen=True)
class Member:
    """One place of a finding.

    Attributes:
        place: name of the joint, link or base.
        joint: which joint, from 1; None of links and of the base.
        values: by parameter name, with the unit as suffix.
        errors: standard errors by the same names.
    """

    place: str
    joint: int | None
    values: Mapping[str, float]
    errors: Mapping[str, float]


@dataclass(frozen=True)
class Event:
    """When something acted.

    Attributes:
        trial: which, from 0.
        start_s: on the trial's log's clock [s].
        duration_s: [s].
    """

    trial: int
    start_s: float
    duration_s: float


@dataclass(frozen=True)
class Rival:
    """What else may be in a finding's place.

    Attributes:
        cause, place, joint: as of findings.
        probability: of it.
        nats: by how much it is less likely than the finding.
    """

    cause: str
    place: str
    joint: int | None
    probability: float
    nats: float


@dataclass(frozen=True)
class Finding:
    """A cause that is there, and why.

    Attributes:
        cause: name in the tables of causes; ``unlisted`` if none of them is as likely as something else there.
        place: name of the joint, link or base; ``all joints`` of a kind.
        joint: which joint, from 1; None of links, the base and a kind.
        partner: the other joint of a coupled drive, from 1.
        members: the places with their values; more than one only of a kind.
        shape: numbers inside its columns, such as ``share`` of the typical speed.
        of: signal of the joint that something unlisted is a function of; empty where that is not known.
        law: of something unlisted, what it is a function of, and which.
        event: when it acted, if it did so once.
        probability: that it is this cause, at this place.
        over_nothing: by how much it is likelier than nothing in its place [nats].
        nothing: probability that nothing is there.
        unlisted: probability that something is there that no table lists.
        rivals: what else may be there, the likeliest first.
        told: causes and places of the smallest set that holds 90 %, the likeliest first.
        folds: by how much each trial, predicted by the others, is likelier with it beside the findings before [nats].
        in_sample: share of the model's misfit that it removes beyond the findings before it.
        held_out: the same in trials predicted by the others; None of a single trial and of events.
    """

    cause: str
    place: str
    joint: int | None
    members: tuple[Member, ...]
    probability: float
    over_nothing: float
    nothing: float
    unlisted: float
    partner: int | None = None
    shape: Mapping[str, float] = field(default_factory=dict)
    of: str = ""
    law: Law | None = None
    event: Event | None = None
    rivals: tuple[Rival, ...] = ()
    told: tuple[tuple[str, str], ...] = ()
    folds: tuple[float, ...] = ()
    in_sample: float = 0.0
    held_out: float | None = None


@dataclass(frozen=True)
class Scatter:
    """A kind whose members are off by more than three tolerances, all alike.

    Attributes:
        cause: name in the tables of causes.
        factor: root mean square of how far they are off over their tolerances.
        tolerance: by parameter name.
        members: the farthest off first.
    """

    cause: str
    factor: float
    tolerance: Mapping[str, float]
    members: tuple[Member, ...]


@dataclass(frozen=True)
class Offer:
    """What one more cause would gain.

    Attributes:
        cause, place, joint: as of findings.
        nats: log odds over nothing.
    """

    cause: str
    place: str
    joint: int | None
    nats: float


@dataclass(frozen=True)
class Limit:
    """What would have been noticed nine times in ten.

    Attributes:
        cause, place, joint: as of findings.
        sizes: by parameter name; None where these logs say nothing of it.
    """

    cause: str
    place: str
    joint: int | None
    sizes: Mapping[str, float | None]


@dataclass(frozen=True, eq=False, kw_only=True)
class Verdict:
    """What logs say of a model.

    Attributes:
        trials: their names.
        reference: names of the trials of the machine while it was well.
        verdict: one of the five words.
        findings: in the order of their worth.
        suspected: those that are too improbable to be named.
        scatter: kinds that are off everywhere.
        validated: whether there are two trials at least.
        chi2_per_n: squares over the noise's variance per row, as modelled, with tolerances, and with the findings.
        before, after: what one more cause would gain with nothing found, and with what is found.
        limits: what would have been noticed.
        notes: sentences.
        finished: whether the search came to its end.
        traces: residuals by trial, for pictures.
    """

    trials: tuple[str, ...]
    reference: tuple[str, ...] = ()
    verdict: Word
    findings: tuple[Finding, ...]
    suspected: tuple[Finding, ...]
    scatter: tuple[Scatter, ...]
    validated: bool
    chi2_per_n: tuple[float, float, float]
    before: tuple[Offer, ...]
    after: tuple[Offer, ...]
    limits: tuple[Limit, ...]
    notes: tuple[str, ...]
    finished: bool
    traces: Callable[[], list[Trace]]


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


def held_readings(
    found: Iterable[tuple[int, Sequence[Event], float]],
    total_s: float,
    words: Callable[[int], tuple[str, int, str]],
) -> list[HeldReadings]:
    """What all encoders do in some trials.

    Args:
        found: encoder, events and nats, for each trial.
        total_s: duration of all trials [s].
        words: place and joint of an encoder, and what it reads.
    """
    events: dict[int, list[Event]] = {}
    nats: dict[int, float] = {}
    for encoder, times, worth in found:
        events.setdefault(encoder, []).extend(times)
        nats[encoder] = nats.get(encoder, 0.0) + worth
    return [
        HeldReadings(*words(k), own, sum(event.duration_s for event in own) / total_s, nats[k])
        for k, own in sorted(events.items())
        if own
    ]


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
