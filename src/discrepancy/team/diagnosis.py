"""Diagnose recordings of one payload that a team carries."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from discrepancy import rules
from discrepancy.engine.diagnose import When, diagnose
from discrepancy.engine.explanation import explain
from discrepancy.inference.odds import check_odds
from discrepancy.inference.search import Searched, search
from discrepancy.result.diagnosed import Diagnosed
from discrepancy.team.chattering import chattering
from discrepancy.team.checks import check_estimate, check_recordings
from discrepancy.team.estimates import errors, estimates, seen_by
from discrepancy.team.long.choice import Choice
from discrepancy.team.long.search import search_parts
from discrepancy.team.rig import AsFound, TeamRig
from discrepancy.team.tolerances import read_tolerances
from discrepancy.team.traces import traces
from discrepancy.team.words import TeamWords
from estimator.errors import InputError
from estimator.estimate.frames import ENCODERS, in_encoder_frames
from estimator.estimate.payload import estimate_payload
from estimator.recording.model import Recording


def diagnose_team(
    recordings: Sequence[Recording],
    tolerances: Mapping[str, Mapping[str, float]] | None = None,
    excluded: Sequence[str] = (),
    *,
    closed_loop: bool = True,
    laws: When = "auto",
    odds: float = rules.PRIOR_ODDS,
    whole: bool = False,
    jobs: int = 1,
    say: Callable[[str], object] = lambda _: None,
    simulated: Callable[[int], object] | None = None,
) -> Diagnosed:
    """Check and estimate recordings, and find out what the simulation gets wrong.

    Args:
        recordings: trials of one payload; several, so that what is named can be validated.
        tolerances: standard deviations by cause and parameter (``read_tolerances``); None for the defaults.
        excluded: causes left out of the catalogue.
        closed_loop: whether to run the recorded commands again.
        laws: whether to look for laws that the catalogue lacks.
        odds: of any cause being there before the data are seen, at all its places together.
        whole: whether to search all of long recordings, not a choice of their parts.
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

    def rig_of(parts: list[Recording]) -> TeamRig:
        say("linearise")
        return TeamRig.of(parts, estimate, known, excluded, jobs)

    choice, searched, notes = Choice.of(recordings, whole=whole), None, ()
    if choice.others:
        prior = check_odds(odds)
        parts = search_parts(
            choice,
            lambda some: search(rig_of(some), progress=say, odds=prior),
            _as_found,
            say,
        )
        choice, searched, notes = parts.choice, parts.searched, parts.notes
    found = diagnose(
        searched.rig if searched else rig_of(choice.searched), closed_loop=closed_loop, laws=laws, odds=odds,
        searched=searched, jobs=jobs, say=say, simulated=simulated,
    )  # fmt: skip
    assert isinstance(found.rig, TeamRig)
    payload, own = estimates(found.rig, found.explanation), partial(traces, found.rig, found.explanation)
    loops = chattering([linear.signals for linear in found.rig.linear])
    units = recordings[0].metadata.units
    if units is not None and in_encoder_frames(units):
        loops = (*loops, f"The payload's centre of mass and grasps are in {ENCODERS}.")
    found = replace(found, notes=(*found.notes, *choice.notes, *notes, *loops))
    return Diagnosed(found.rig, found, TeamWords(), own, payload)


def _as_found(searched: Searched) -> tuple[TeamRig, AsFound]:
    assert isinstance(searched.rig, TeamRig)
    return searched.rig, searched.rig.as_found(explain(searched))


def against_truth(found: Diagnosed, truth: Mapping[str, Any]) -> Diagnosed:
    """The same with the errors of its estimates.

    Args:
        found: of ``diagnose_team``.
        truth: the payload, in the form of ``GroundTruth.to_dict``; where it is of something else there are no errors.
    """
    known = dict(found.estimates or {})
    try:
        assert isinstance(found.rig, TeamRig)
        truth = seen_by(found.rig.recordings[0].metadata.units, truth)
        known["errors"] = {name: errors(known[name], truth) for name in ("before", "after")}
    except (KeyError, TypeError, ValueError, IndexError, OverflowError):
        return found
    return replace(found, estimates=known)
