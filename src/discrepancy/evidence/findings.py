"""Findings of a search in physical values, the verdict, and encoders that hold their last value."""

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
        joint: number of the joint, from 1; None for links and the base.
        values: by parameter name, with the unit as suffix.
        errors: standard errors by the same names.
    """

    place: str
    joint: int | None
    values: Mapping[str, float]
    errors: Mapping[str, float]


@dataclass(frozen=True)
class Event:
    """Time interval of an event.

    Attributes:
        trial: index of the trial, from 0.
        start_s: start on the clock of the trial's log [s].
        duration_s: duration [s].
    """

    trial: int
    start_s: float
    duration_s: float


@dataclass(frozen=True)
class Rival:
    """An alternative to a finding.

    Attributes:
        cause, place, joint: as in ``Finding``.
        probability: its probability.
        nats: log odds of the finding over it.
    """

    cause: str
    place: str
    joint: int | None
    probability: float
    nats: float


@dataclass(frozen=True)
class Finding:
    """A cause in the verdict, with its evidence.

    Attributes:
        cause: name in the tables of causes; ``unlisted`` if an unlisted effect is likelier than each of them.
        place: name of the joint, link or base; ``all joints`` for a cause of several members.
        joint: number of the joint, from 1; None for links, the base and several members.
        partner: number of the other joint of a coupled drive, from 1.
        members: places with their values; several only for a cause at all joints.
        shape: parameters inside its columns, such as ``share`` of the typical speed.
        of: argument of an unlisted effect, a signal of the joint; empty if unknown.
        law: formula of an unlisted effect.
        event: time interval of an event.
        probability: probability of this cause at this place.
        over_nothing: log odds over nothing in its place [nats].
        nothing: probability of nothing.
        unlisted: probability of an unlisted effect.
        rivals: alternatives, likeliest first.
        told: causes and places of the smallest set with 90 % of the probability, likeliest first.
        folds: log odds that each trial, predicted from the others, gains from it beside the findings before [nats].
        in_sample: share of the model's misfit that it removes beyond the findings before it.
        held_out: the same in trials predicted from the others; None for a single trial and for events.
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
    """A cause whose places all deviate, by more than three tolerances together.

    Attributes:
        cause: name in the tables of causes.
        factor: root mean square of the deviations over their tolerances.
        tolerance: by parameter name.
        members: places, largest deviation first.
    """

    cause: str
    factor: float
    tolerance: Mapping[str, float]
    members: tuple[Member, ...]


@dataclass(frozen=True)
class Offer:
    """The gain of one more cause.

    Attributes:
        cause, place, joint: as in ``Finding``.
        nats: log odds over nothing.
    """

    cause: str
    place: str
    joint: int | None
    nats: float


@dataclass(frozen=True)
class Limit:
    """Size of a cause that the search would detect with 90 % probability.

    Attributes:
        cause, place, joint: as in ``Finding``.
        sizes: by parameter name; None if the logs have no information.
    """

    cause: str
    place: str
    joint: int | None
    sizes: Mapping[str, float | None]


@dataclass(frozen=True, eq=False, kw_only=True)
class Verdict:
    """Verdict on a model.

    Attributes:
        trials: names of the trials.
        reference: names of the trials of the machine in a healthy state.
        verdict: one of the five words.
        findings: named causes, in the order of their evidence.
        suspected: causes that are too improbable to be named.
        scatter: causes whose places all deviate.
        validated: whether there are at least two trials.
        chi2_per_n: squared residuals over the noise variance, per row: as modelled, with tolerances, with the findings.
        before, after: gains of one more cause, without and with the findings in the model.
        limits: detection limits.
        notes: sentences.
        finished: whether the search completed.
        traces: returns the residuals by trial, for plots.
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
    """Intervals in which one encoder holds its last value.

    Attributes:
        place, joint: its joint, by name and by number from 1.
        of: its measured quantity and place, in words.
        events: the intervals, in time order.
        share: their share of the time of all trials.
        nats: log odds over a joint that moves like this.
    """

    place: str
    joint: int
    of: str
    events: Sequence[Event]
    share: float
    nats: float

    @property
    def finding(self) -> Finding:
        """Convert to a finding."""
        return Finding(
            cause="unlisted", place=self.place, joint=self.joint, members=(), probability=1.0, nothing=0.0,
            unlisted=1.0, over_nothing=self.nats, event=self.events[0],
            shape={"held": float(len(self.events)), "share": self.share},
        )  # fmt: skip

    @property
    def note(self) -> str:
        """A sentence on number, duration and time of the intervals."""
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
    """Collect the held readings of all encoders.

    Args:
        found: encoder index, intervals and log odds, for each trial and encoder.
        total_s: duration of all trials [s].
        words: returns place, joint and quantity of an encoder.
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
    """Add a finding and a note to the verdict for each encoder that holds its value.

    The diagnosis already excludes the affected rows, so they do not influence its other findings.
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
    """JSON values in words for a finding of held readings; empty for other findings."""
    if "held" not in finding.shape:
        return {}
    times, share = finding.shape["held"], 100.0 * finding.shape["share"]
    sentence = f"{place}: the encoder holds its last value {times:.0f} times, for {share:.1f} % of the time."
    return {"kind": KIND, "name": f"{KIND} at {place}", "place": place, "sentence": sentence}
