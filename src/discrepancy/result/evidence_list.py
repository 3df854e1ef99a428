"""The strongest candidates, with nothing named yet and with what is named in the model."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from discrepancy import rules
from discrepancy.candidate import Candidate
from discrepancy.engine.explanation import Explanation
from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.inference.prior import log_prior_odds
from discrepancy.inference.scan import scan
from discrepancy.least_squares.fit import Fit
from discrepancy.least_squares.problem import Problem
from discrepancy.result.read import kind_of, name_of

MOST, CLOSELY = 14, 16
"""Candidates that are listed, and that are looked at for it."""


def evidence_list(explanation: Explanation) -> dict[str, Any]:
    """Plain data: ``before`` and ``after`` (null where nothing is named), lists of the strongest first.

    Each entry has cause, family, robot, joint, place, ``at`` (trial from 1 and start [s] of an event, else null),
    ``nats`` (log Bayes factor that it is there beside what is in the model, spreads and noise learnt anew with it) and
    ``needed`` (as many nats name it, by its prior odds).
    """
    problem, named = _with_shapes(explanation)
    # What a healthy one would explain with what it leaves open is not to a cause's credit, as in the search.
    credit = explanation.hypothesis.allowed
    allowed = {at: credit[i] for at, i in zip(named, explanation.hypothesis.free, strict=True) if i in credit}
    nothing = Hypothesis(explanation.nothing.learnt, allowed)
    if problem is not nothing.problem:
        nothing = Hypothesis.of(problem, (), allowed)
    return {
        "before": _strongest(nothing, named),
        "after": _strongest(explanation.hypothesis, {}) if explanation.found else None,
    }


def needed_nats(problem: Problem, candidate: Candidate) -> float:
    """Log Bayes factor from which a candidate is named [nats]."""
    return rules.NAMED_NATS - log_prior_odds(problem, candidate)


def drawn(strongest: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Candidates with at least 1 nat; less is nothing on a scale of multiples."""
    return [entry for entry in strongest if entry["nats"] >= 1.0]


def _with_shapes(explanation: Explanation) -> tuple[Problem, dict[int, Problem]]:
    """The problem without causes, their columns in it as found; and for each cause with what it leaves open."""
    best, problem, at = explanation.hypothesis, explanation.nothing.problem, []
    for index in best.free:
        candidate, span = best.problem.candidates[index], best.problem.spans[index]
        columns = [best.problem.raw_columns(t, span) / candidate.units for t in best.problem.trials]
        known = problem.index_of(candidate)
        at.append(len(problem.candidates) if known is None else known)
        if known is None:
            problem = problem.extended(candidate, columns)
        elif problem.candidates[known] is not candidate:
            problem = problem.with_columns(known, candidate, columns)
    out = {}
    for index, candidate in zip(at, best.causes, strict=True):
        own = best.problem.opened.get(candidate.key)
        left_open = [one.columns for one in own] if own else []
        out[index] = problem.with_unknowns(candidate.key, left_open, own[0].size if own else 0.0)
    return problem, out


def _strongest(base: Hypothesis, named: Mapping[int, Problem]) -> list[dict[str, Any]]:
    judged = [(nats(base, index, named.get(index)), index) for index in _looked_at(base, named)]
    out = []
    for value, index in sorted(judged, reverse=True)[:MOST]:
        candidate = base.problem.candidates[index]
        if value > 0.0:
            told = {"at": at_of(candidate), "nats": value, "needed": needed_nats(base.problem, candidate)}
            out.append(place_of(candidate) | told)
    return out


def _looked_at(base: Hypothesis, named: Mapping[int, Problem]) -> list[int]:
    """What is named, and what the scan puts first: with spreads as learnt, or with tolerances."""
    problem = base.problem
    held = replace(problem, spread=np.where(problem.tolerant, 1.0, problem.spread))
    score: dict[int, float] = {}
    for item in (*scan(base.fit), *scan(Fit.of(held, base.free))):
        if item.index is not None:
            score[item.index] = max(item.score, score.get(item.index, -np.inf))
    ranked = sorted(score, key=lambda index: -score[index])
    return list(dict.fromkeys([*named, *ranked[:CLOSELY]]))


def nats(base: Hypothesis, index: int, problem: Problem | None = None) -> float:
    """Log Bayes factor that one candidate is there beside a hypothesis.

    Args:
        base: the hypothesis.
        index: which of its problem's candidates.
        problem: with what it leaves open, if it is not the hypothesis' own.
    """
    more = Hypothesis.of(problem or base.problem, (*base.free, index), base.allowed)
    return float(more.score - base.score - log_prior_odds(base.problem, base.problem.candidates[index]))


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
