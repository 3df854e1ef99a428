"""The strongest candidates, with nothing named yet and with what is named in the model."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from discrepancy import rules
from discrepancy.engine.explanation import Explanation
from discrepancy.engine.prior import log_prior_odds
from discrepancy.engine.scan import log_bayes_factor, score_of
from discrepancy.least_squares.fit import Fit
from discrepancy.least_squares.problem import Problem
from discrepancy.result.read import kind_of, name_of
from discrepancy.rig import Candidate

MOST = 14


def evidence_list(explanation: Explanation) -> dict[str, Any]:
    """Plain data: ``before`` and ``after`` (null where nothing is named), lists of the strongest first.

    Each entry has cause, family, robot, joint, place, ``at`` (trial from 1 and start [s] of an event, else null),
    ``nats`` (log Bayes factor: that it is off beyond the spread of its kind, over that it is not) and ``needed`` (as
    many nats name it, by its prior odds).
    """
    nothing, fit = explanation.nothing, explanation.fit
    before = [*_listed(nothing.fit), *_events(explanation)]
    return {
        "before": _strongest(nothing.problem, before),
        "after": _strongest(fit.problem, [*_listed(fit)]) if explanation.found else None,
    }


def needed_nats(problem: Problem, candidate: Candidate) -> float:
    """Log Bayes factor from which a candidate is named [nats]."""
    return rules.NAMED_NATS - log_prior_odds(problem, candidate)


def _listed(fit: Fit) -> Iterator[tuple[Candidate, float]]:
    """Log Bayes factors of all candidates that are not in the model."""
    for index, candidate in enumerate(fit.problem.candidates):
        if index not in fit.free:
            yield candidate, score_of(fit, index) - log_prior_odds(fit.problem, candidate)


def _events(explanation: Explanation) -> Iterator[tuple[Candidate, float]]:
    """The same of events that were found; the problem without causes does not have them."""
    problem = explanation.problem
    for index in explanation.fit.free:
        candidate = problem.candidates[index]
        if candidate.transient is not None:
            told = explanation.nothing.fit.told_by([x[..., problem.spans[index]] for x in problem.raw])
            yield candidate, log_bayes_factor(*told, 1.0 if candidate.parameters[0].tolerance else 0.0)


def _strongest(problem: Problem, judged: Sequence[tuple[Candidate, float]]) -> list[dict[str, Any]]:
    out = []
    for candidate, nats in sorted(judged, key=lambda pair: -pair[1])[:MOST]:
        if nats > 0.0:
            told = {"at": at_of(candidate), "nats": float(nats), "needed": needed_nats(problem, candidate)}
            out.append(place_of(candidate) | told)
    return out


def at_of(candidate: Candidate) -> list[float] | None:
    """Trial (from 1) and start [s] of an event; None of what lasts."""
    at = candidate.transient
    return [at.trial + 1, float(at.start_s)] if at else None


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
