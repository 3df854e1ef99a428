"""Diagnose recordings of one payload that a team carries."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np

from discrepancy.evidence.findings import Event, HeldReadings, held_readings, with_held
from discrepancy.evidence.judge import is_named
from discrepancy.evidence.probability import odds_of, without_unfounded
from discrepancy.evidence.search import Until
from discrepancy.evidence.settings import ODDS, SETTINGS
from discrepancy.team.causes import read_tolerances
from discrepancy.team.diagnose import TeamOutcome, search_team
from discrepancy.team.estimates import errors, seen_by
from discrepancy.team.linear.noise import chattering
from discrepancy.team.linear.signals import TEAM_TRIM_S
from discrepancy.team.long import Choice, search_parts
from discrepancy.team.response import confirm, left_by
from discrepancy.team.rig import TeamRig
from discrepancy.team.told import TeamDiagnosed
from discrepancy.team.two_bodies import TwoBodyDiagnosed, find_joint
from discrepancy.team.verdict import judged_team
from estimator.arm.unit import ENCODERS, ArmUnit, in_encoder_frames
from estimator.errors import InputError
from estimator.estimate.payload import estimate_payload
from estimator.estimate.result import PayloadEstimate
from estimator.estimate.statics import CONTRADICTION
from estimator.quantisation import angle_of, without_held
from estimator.recording.checks import check_carries
from estimator.recording.model import Recording

GOOD_S = 30.0
"""Length of motion from which a diagnosis is useful [s]; only quoted in a message. Chosen."""

LEAST_S = 5.0
"""Least total length of recordings that is diagnosed [s]. Chosen."""


def check_recordings(recordings: Sequence[Recording]) -> None:
    """Check that recordings suffice and come from one team.

    Raises:
        InputError: there is no recording, one has empty grasps or a single robot, robots or design differ, or the
            recordings are too short.
    """
    if not recordings:
        raise InputError("no recording given; name at least one file")
    for recording in recordings:
        check_carries(recording, "diagnosed")
    first = recordings[0]
    if first.metadata.robots < 2:
        raise InputError(
            f"{first.name} has one robot; without a second one nothing tells where the payload really is, so there is "
            "nothing to diagnose"
        )
    used = [max(0.0, recording.time[-1] - recording.time[0] - 2.0 * TEAM_TRIM_S) for recording in recordings]
    if sum(used) < LEAST_S:
        names = ", ".join(recording.name for recording in recordings)
        raise InputError(
            f"{names}: {sum(used):.1f} s are left when {TEAM_TRIM_S:g} s are dropped at both ends; a "
            f"diagnosis needs at least {LEAST_S:g} s, and {GOOD_S:g} s of motion to be worth much"
        )
    for other in recordings[1:]:
        if other.metadata.robots != first.metadata.robots:
            raise InputError(
                f"{other.name} has {other.metadata.robots} robots and {first.name} has {first.metadata.robots}; "
                "recordings of one payload must have the same robots"
            )
        if other.metadata.design != first.metadata.design:
            raise InputError(
                f"{other.name} and {first.name} are of robots of different design; diagnose one at a time"
            )
        if not same_units(other.metadata.units, first.metadata.units):
            raise InputError(
                f"{other.name} and {first.name} carry different calibrations; give one to both (--calibration)"
            )


def same_units(a: ArmUnit | None, b: ArmUnit | None) -> bool:
    """Whether two recordings have the same calibration, or both have none."""
    return a is b or (a is not None and b is not None and np.array_equal(a.x, b.x))


def check_estimate(estimate: PayloadEstimate) -> None:
    """Check that the wrenches do not contradict each other, because then there is no payload to model.

    Raises:
        InputError: they do.
    """
    if estimate.p_1c is None and any(CONTRADICTION in flag for flag in estimate.flags):
        names = ", ".join(recording.name for recording in estimate.recordings)
        raise InputError(
            f"{names}: the robots' wrenches do not add up to one payload, so there is nothing to hold the data "
            "against; is a robot missing, or a torque's sign or column wrong?"
        )


KINDS = ("driven joint", "gimbal axis")


def held_in(recordings: Sequence[Recording]) -> list[HeldReadings]:
    """Find encoders that repeat their last value for a while in any of a team's trials."""
    found = []
    for trial, recording in enumerate(recordings):
        rate_hz = recording.metadata.rate_hz
        for held in without_held(recording)[1]:
            times = [Event(trial, float(recording.time[a]), (b - a) / rate_hz) for a, b in held.spans]
            found.append((held.column, times, held.nats))

    def words(column: int) -> tuple[str, int, str]:
        kind, robot, joint = angle_of(column, recordings[0].metadata.robots)
        place = f"{KINDS[kind]} {joint + 1} of robot {robot + 1}"
        return place, joint + 1, f"the angle of {place}"

    return held_readings(found, sum(len(r.time) / r.metadata.rate_hz for r in recordings), words)


When = Literal["auto", "always", "never"]


def diagnose_team(
    recordings: Sequence[Recording],
    tolerances: Mapping[str, Mapping[str, float]] | None = None,
    excluded: Sequence[str] = (),
    *,
    closed_loop: bool = True,
    laws: When = "auto",
    odds: float = ODDS,
    whole: bool = False,
    seconds: float | None = None,
    jobs: int = 1,
    say: Callable[[str], object] = lambda _: None,
    simulated: Callable[[int], object] | None = None,
) -> TeamDiagnosed | TwoBodyDiagnosed:
    """Check recordings of one payload, estimate it, and find what the simulation gets wrong.

    Args:
        recordings: trials of one payload; several trials allow cross-validation.
        tolerances: standard deviations by cause and parameter (``read_tolerances``); None for the defaults.
        excluded: causes left out of the catalogue.
        closed_loop: whether to simulate the recorded commands again.
        laws: when to search for unlisted laws: if the noise exceeds that of the sensors (``auto``), always, or never.
        odds: prior odds of each kind of cause, over all its places together.
        whole: whether to search all of long recordings, not a selection of their parts.
        seconds: time after which the search stops with its current result; None for no limit.
        jobs: parallel processes.
        say: takes the name of each stage.
        simulated: called with 1 for every simulated trial.

    Raises:
        InputError: the recordings do not belong together, are too short, or do not determine the payload, or an
            excluded cause does not exist.
    """
    check_recordings(recordings)
    two = find_joint(recordings, say)
    if two is not None:
        return two
    say("estimate")
    # A payload mass that differs between trials is a cause of its own, unless that cause is excluded.
    estimate = estimate_payload(recordings, compare_masses="payload_mass" in excluded, withhold=False)
    try:
        check_estimate(estimate)
    except InputError:
        # If no model fits, an error about different masses is clearer.
        estimate_payload(recordings, compare_masses=True, withhold=False)
        raise
    known = read_tolerances(None) if tolerances is None else tolerances
    settings = SETTINGS if odds == ODDS else replace(SETTINGS, cause_nats=-math.log(odds))
    until = Until(math.inf if seconds is None else time.monotonic() + seconds)

    def search(parts: list[Recording]) -> TeamOutcome:
        say("linearise")
        rig = replace(TeamRig.of(parts, estimate, known, excluded, jobs), laws=laws)
        return search_team(rig, settings, say, until)

    choice, notes = Choice.of(recordings, whole=whole), ()
    if choice.others:
        choice, outcome, notes = search_parts(choice, search, left_by, say)
    else:
        outcome = search(choice.searched)
    say("weighing what else each cause may be")
    outcome = replace(outcome, state=without_unfounded(outcome.search, outcome.state))
    weighed = odds_of(outcome.search, outcome.state)
    rig = outcome.rig
    why_not = rig.can_resimulate() if closed_loop else "the closed loop was left out on request"
    gain, contradicted = None, False
    if why_not is None:
        say("simulate")
        confirmed = confirm(outcome, [o for o in weighed if is_named(o)], jobs, simulated)
        others = [o for o in weighed if not is_named(o)]
        outcome, weighed, gain = confirmed.outcome, [*confirmed.odds, *others], confirmed.gain
        notes, contradicted = (*notes, *confirmed.notes), confirmed.contradicted
    loops = chattering([linear.signals for linear in rig.linear])
    units = recordings[0].metadata.units
    if units is not None and in_encoder_frames(units):
        loops = (*loops, f"The payload's centre of mass and grasps are in {ENCODERS}.")
    verdict = judged_team(outcome, weighed, (*notes, *choice.notes, *loops), contradicted=contradicted)
    return TeamDiagnosed(with_held(verdict, held_in(choice.searched)), outcome, gain, why_not)


def against_truth(found: TeamDiagnosed, truth: Mapping[str, Any]) -> TeamDiagnosed:
    """Add the errors of the estimates.

    Args:
        found: result of ``diagnose_team``.
        truth: the payload, in the form of ``GroundTruth.to_dict``. A truth in another form adds no errors.
    """
    known = found.verdict.estimates
    try:
        truth = seen_by(found.verdict.rig.recordings[0].metadata.units, truth)
        return replace(found, errors={name: errors(known[name], truth) for name in ("before", "after")})
    except (KeyError, TypeError, ValueError, IndexError, OverflowError):
        return found
