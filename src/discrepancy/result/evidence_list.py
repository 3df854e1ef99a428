"""The strongest candidates, with nothing named yet and with what is named in the model."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from discrepancy.engine.explanation import Explanation
from discrepancy.least_squares.fit import Fit
from discrepancy.result.read import kind_of, name_of
from discrepancy.rig import Candidate

LEAST_LOG10_P = -1e6
MOST = 14
BY_CHANCE = 28.0
"""Gain of chi-square that one parameter reaches by chance with a probability of about 1e-6 or 1e-7."""


def evidence_list(explanation: Explanation) -> dict[str, Any]:
    """Plain data: ``before`` and ``after`` (null where nothing is named), lists of the strongest first.

    Each entry has cause, family, robot, joint, place, ``at`` (trial from 1 and start [s] of an event, else null), gain
    (of chi-square if its parameters leave their tolerance) and log10_p (of as much by chance). ``by_chance`` is what
    chance can do.
    """
    problem = explanation.problem
    return {
        "before": _strongest(explanation, Fit.of(problem)),
        "after": _strongest(explanation, explanation.fit) if explanation.fit.free else None,
        "by_chance": BY_CHANCE,
    }


def _strongest(explanation: Explanation, fit: Fit) -> list[dict[str, Any]]:
    out = []
    for e in sorted(fit.evidence(fit.inflation), key=lambda e: -e.gain)[:MOST]:
        candidate = explanation.problem.candidates[e.index]
        at = candidate.transient
        when = [at.trial + 1, float(at.start_s)] if at else None
        told = {"at": when, "gain": float(e.gain), "log10_p": finite_log10_p(e.log10_p)}
        out.append(place_of(candidate) | told)
    return out


def finite_log10_p(value: float) -> float:
    """A logarithm of a probability that JSON can hold."""
    return max(float(np.nan_to_num(value, nan=0.0)), LEAST_LOG10_P)


def place_of(candidate: Candidate) -> dict[str, Any]:
    """Cause (its name, in words, in words at its place), family and place of a candidate, as all over the JSON."""
    return {
        "cause": candidate.cause,
        "kind": candidate.kind,
        "name": candidate.label,
        "family": candidate.family,
        "robot": candidate.robot,
        "joint": candidate.joint,
        "place": candidate.place,
    }


def label(entry: Mapping[str, Any]) -> str:
    """An entry in words, for a plot."""
    if entry["at"] is None:
        return name_of(entry)
    return f"{kind_of(entry)} (trial {entry['at'][0]}, {entry['at'][1]:.1f} s)"


def relation(entry: Mapping[str, Any], causes: Sequence[Mapping[str, Any]]) -> str:
    """What an entry is to the named causes: ``named``, of their ``family``, or ``other``."""
    place = ("cause", "robot", "joint")
    if any(all(entry[key] == cause[key] for key in place) for cause in causes):
        return "named"
    return "family" if any(entry["family"] == cause["family"] for cause in causes) else "other"
