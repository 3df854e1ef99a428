"""What a search found at a robot's joints, link by link, in physical values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


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
        event: when it acted, if it did so once.
        probability: that it is this cause, at this place.
        over_nothing: by how much it is likelier than nothing in its place [nats].
        nothing: probability that nothing is there.
        unlisted: probability that something is there that no table lists.
        rivals: what else may be there, the likeliest first.
        told: causes and places of the smallest set that holds 90 %, the likeliest first; empty strings: unlisted.
        folds: by how much each trial is likelier with it, foretold by the other trials [nats].
        in_sample: share of the model's misfit that it removes beyond the findings before it.
        held_out: the same in trials foretold by the others; None of a single trial and of events.
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
    event: Event | None = None
    rivals: tuple[Rival, ...] = ()
    told: tuple[tuple[str, str], ...] = ()
    folds: tuple[float, ...] = ()
    in_sample: float = 0.0
    held_out: float | None = None
