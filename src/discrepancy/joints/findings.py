"""What a search found at a robot's joints, link by link, in physical values."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

from discrepancy.joints.model import SerialModel
from discrepancy.joints.servo.motor import Motor
from discrepancy.joints.signals import Signals
from discrepancy.result.traces import Trace
from estimator.arrays import Array

Verdict = Literal["consistent", "miscalibrated", "explained", "partly_explained", "unexplained"]


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
        event: when it acted, if it did so once.
        probability: that it is this cause, at this place.
        over_nothing: by how much it is likelier than nothing in its place [nats].
        nothing: probability that nothing is there.
        unlisted: probability that something is there that no table lists.
        rivals: what else may be there, the likeliest first.
        told: causes and places of the smallest set that holds 90 %, the likeliest first.
        folds: by how much each trial, foretold by the others, is likelier with it beside the findings before [nats].
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
    of: str = ""
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


@dataclass(frozen=True, eq=False)
class Foretold:
    """How well the torques of one trial are foretold by the others.

    Attributes:
        trial: its name.
        before, after: root mean squares of measured minus foretold torque without and with the findings, as the other
            trials have them, shape (J,) [N m or N].
        noise: of the rows, shape (J,).
        torque: root mean square of the measured torque, shape (J,).
        chi2_before, chi2_after: squares over the noise's variance, per row.
    """

    trial: str
    before: Array
    after: Array
    noise: Array
    torque: Array
    chi2_before: float
    chi2_after: float


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


@dataclass(frozen=True, eq=False)
class JointVerdict:
    """What logs say of a model of a robot of joints.

    Attributes:
        model: the robot as described.
        parts: the trials: smoothed logs, or parts of one.
        trials: their names.
        motors: drives that tell no torque, and what they give by what they were given.
        reference: names of the trials of the robot while it was well.
        verdict: one of the five.
        findings: in the order of their worth.
        suspected: those that are too improbable to be named.
        scatter: kinds that are off everywhere.
        foretold: one a trial, each by the others; by all of them where there is one trial only (``validated``).
        validated: whether there are two trials at least.
        chi2_per_n: squares over the noise's variance per row, as modelled, with tolerances, and with the findings.
        before, after: what one more cause would gain with nothing found, and with what is found.
        limits: what would have been noticed.
        notes: sentences.
        finished: whether the search came to its end.
        by_the_others: for the number of a trial, the findings with values fitted to the other trials, without events.
        traces: residuals by trial, for pictures.
    """

    model: SerialModel
    parts: Sequence[Signals]
    trials: tuple[str, ...]
    motors: tuple[Motor, ...]
    reference: tuple[str, ...]
    verdict: Verdict
    findings: tuple[Finding, ...]
    suspected: tuple[Finding, ...]
    scatter: tuple[Scatter, ...]
    foretold: tuple[Foretold, ...]
    validated: bool
    chi2_per_n: tuple[float, float, float]
    before: tuple[Offer, ...]
    after: tuple[Offer, ...]
    limits: tuple[Limit, ...]
    notes: tuple[str, ...]
    finished: bool
    by_the_others: Callable[[int], tuple[Finding, ...]]
    traces: Callable[[], list[Trace]]
