"""Diagnose recordings of one payload that a team carries."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal

from discrepancy.evidence.held import with_held
from discrepancy.evidence.judge import is_named
from discrepancy.evidence.odds import borne_out, odds_of
from discrepancy.evidence.settings import ODDS, SETTINGS
from discrepancy.evidence.until import Until
from discrepancy.team.checks import check_estimate, check_recordings
from discrepancy.team.diagnose import TeamOutcome, search_team
from discrepancy.team.estimates import errors, seen_by
from discrepancy.team.held import held_in
from discrepancy.team.linear.chatter import chattering
from discrepancy.team.long.choice import Choice
from discrepancy.team.long.search import search_parts
from discrepancy.team.response import as_found, confirm
from discrepancy.team.rig import TeamRig
from discrepancy.team.told import TeamDiagnosed
from discrepancy.team.tolerances import read_tolerances
from discrepancy.team.verdict import judged_team
from estimator.arm.unit import ENCODERS, in_encoder_frames
from estimator.errors import InputError
from estimator.estimate.payload import estimate_payload
from estimator.recording.model import Recording

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
) -> TeamDiagnosed:
    """Check and estimate recordings of one payload, and find out what the simulation gets wrong.

    Args:
        recordings: trials of one payload; several, so that what is named can be validated.
        tolerances: standard deviations by cause and parameter (``read_tolerances``); None for the defaults.
        excluded: causes left out of the catalogue.
        closed_loop: whether to run the recorded commands again.
        laws: whether to look for what no table lists: where the noise is louder than the sensors' (``auto``), always,
            or never.
        odds: of any cause being there before the data are seen, at all its places together.
        whole: whether to search all of long recordings, not a choice of their parts.
        seconds: after which the search ends with what it has.
        jobs: parallel processes.
        say: takes the name of the stage that begins.
        simulated: called with 1 for every simulated trial.

    Raises:
        InputError: the recordings do not belong together, are too short, or do not determine the payload, or a
            cause to be excluded does not exist.
    """
    check_recordings(recordings)
    say("estimate")
    # Another mass in some trials is a cause of its own, unless it is none to be named.
    estimate = estimate_payload(recordings, compare_masses="payload_mass" in excluded, withhold=False)
    try:
        check_estimate(estimate)
    except InputError:
        # Where nothing fits, masses that differ are the clearer sentence.
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
        parts = search_parts(choice, search, as_found, say)
        choice, outcome, notes = parts.choice, parts.searched, parts.notes
    else:
        outcome = search(choice.searched)
    say("weighing what else each cause may be")
    outcome = replace(outcome, state=borne_out(outcome.search, outcome.state))
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
    """The same with the errors of its estimates.

    Args:
        found: of ``diagnose_team``.
        truth: the payload, in the form of ``GroundTruth.to_dict``; where it is of something else there are no errors.
    """
    known = found.verdict.estimates
    try:
        truth = seen_by(found.verdict.rig.recordings[0].metadata.units, truth)
        return replace(found, errors={name: errors(known[name], truth) for name in ("before", "after")})
    except (KeyError, TypeError, ValueError, IndexError, OverflowError):
        return found
