"""Run the diagnosis on recordings; the verdict as plain data."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any, Literal

from discrepancy.engine.confirm import Alternative
from discrepancy.engine.diagnose import Diagnosis, When, diagnose
from discrepancy.engine.explanation import Found
from discrepancy.team.rig import TeamRig
from discrepancy.team.tolerances import read_tolerances
from estimator.estimate.payload import estimate_payload
from estimator.recording.model import Recording

Loop = Literal["always", "undecided", "never"]


def verdict_on(
    recordings: Sequence[Recording],
    excluded: Sequence[str] = (),
    closed_loop: Loop = "always",
    laws: When = "auto",
) -> dict[str, Any]:
    """What the diagnosis finds.

    Args:
        recordings: the trials.
        excluded: causes left out of its catalogue.
        closed_loop: when to simulate the recorded commands again; ``undecided`` is where the rows leave two causes
            about equally likely, which saves time.
        laws: whether to look for laws that the catalogue lacks; ``auto`` is where something unlisted is left.
    """
    start = time.perf_counter()
    rig = TeamRig.of(recordings, estimate_payload(recordings), read_tolerances(None), excluded)
    diagnosis = diagnose(rig, closed_loop=closed_loop == "always", laws=laws)
    if closed_loop == "undecided" and _undecided(diagnosis):
        diagnosis = diagnose(rig, laws=laws)
    explanation = diagnosis.explanation
    return {
        "verdict": diagnosis.verdict,
        "found": [_found(rig, *pair) for pair in zip(explanation.found, diagnosis.alternatives, strict=True)],
        "suspected": [[item.candidate.label, item.probability] for item in explanation.suspected],
        "scatter": {item.candidate.cause: item.factor for item in explanation.scatter},
        "unlisted_nats": explanation.unlisted_nats,
        "before": explanation.before / explanation.samples,
        "after": explanation.after / explanation.samples,
        "explained": explanation.explained,
        "closed_loop": diagnosis.gain is not None,
        "notes": list(diagnosis.notes),
        "estimate": _estimate(recordings),
        "seconds": time.perf_counter() - start,
    }


def _estimate(recordings: Sequence[Recording]) -> dict[str, Any]:
    """What a user gets besides: the joint estimate's mass [kg], and whether the robots contradict each other."""
    joint = estimate_payload(recordings, "joint")
    mass = None if joint.mass is None else [joint.mass.mass, joint.mass.se]
    return {"mass_kg": mass, "contradicts": joint.contradicts}


def _undecided(diagnosis: Diagnosis) -> bool:
    return any(rival.ambiguous for rivals in diagnosis.alternatives for rival in rivals)


def _found(rig: TeamRig, item: Found, rivals: Sequence[Alternative]) -> dict[str, Any]:
    candidate = item.candidate
    values, errors = rig.effect_parameters(candidate, item.values, item.covariance)
    return {
        "cause": candidate.cause,
        "family": candidate.family,
        "robot": candidate.robot,
        "joint": candidate.joint,
        "parameters": {name: float(value) for name, value in values.items()},
        "standard_errors": {name: float(value) for name, value in errors.items()},
        "columns": [float(value) for value in item.values],
        "probability": item.probability,
        "over_nothing": item.over_nothing,
        "share_left": item.share_left,
        "in_sample": item.in_sample,
        "held_out": item.held_out,
        "rivals": [
            {
                "cause": rival.candidate.cause,
                "robot": rival.candidate.robot,
                "joint": rival.candidate.joint,
                "gap": float(rival.evidence_gap),
                "ambiguous": bool(rival.ambiguous),
            }
            for rival in rivals
        ],
    }
