"""What each candidate that is not in a hypothesis would add to its evidence, at the powers and spreads it has."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from discrepancy import rules
from discrepancy.candidate import Candidate
from discrepancy.inference.prior import log_prior_odds
from discrepancy.least_squares.fit import Fit
from discrepancy.rig import Rig
from estimator.arrays import Array


@dataclass(frozen=True, eq=False)
class Scanned:
    """A candidate's first judgement.

    Attributes:
        index: which of the problem's; None for an event that is not among them.
        candidate: itself, in its shape.
        score: log odds that it is there [nats].
        columns: of an event or a shape that is not the problem's, else None.
        loud: whether it is looked at closely whatever its score.
        held: whether the score is with its kind within its tolerance, though that scatters.
    """

    index: int | None
    candidate: Candidate
    score: float
    columns: Sequence[Array] | None = None
    loud: bool = False
    held: bool = False


def scan(fit: Fit) -> list[Scanned]:
    """Every candidate of the problem that is not free, the best first."""
    found, candidates = [], fit.problem.candidates
    there = {candidates[i].key for i in fit.free if candidates[i].transient is None}
    for index, candidate in enumerate(candidates):
        if index in fit.free or candidate.hidden or (candidate.transient is None and candidate.key in there):
            continue
        found.append(Scanned(index, candidate, score_of(fit, index)))
    return sorted(found, key=lambda item: -item.score)


def score_of(fit: Fit, index: int) -> float:
    """Log odds that a candidate of the problem is there rather than within its tolerance."""
    problem, candidate = fit.problem, fit.problem.candidates[index]
    spike = float(problem.spread[problem.columns_of(index)][0]) if problem.has_tolerance(index) else 0.0
    return log_bayes_factor(*fit.told(index), spike) + log_prior_odds(problem, candidate)


def score_with(fit: Fit, candidate: Candidate, columns: Sequence[Array], spike: float = 0.0) -> float:
    """The same of a candidate that is not in the model, with columns in its own units, shape (n, C, k) per trial."""
    return scores_with(fit, [(candidate, columns)], spike)[0]


def scores_with(
    fit: Fit, each: Sequence[tuple[Candidate, Sequence[Array]]], spike: float = 0.0
) -> list[float]:
    """The same of several candidates, each alone."""
    told = fit.told_by_each([columns for _, columns in each], [candidate.units for candidate, _ in each])
    return [
        log_bayes_factor(*one, spike) + log_prior_odds(fit.problem, candidate)
        for (candidate, _), one in zip(each, told, strict=True)
    ]


def in_best_shape(rig: Rig, fit: Fit, item: Scanned, loud: Collection[int | None] = ()) -> Scanned:
    """An event without a tolerance in the shape that tells most: in another it may not be seen at all.

    So may some that have a tolerance (``Rig.shaped``), at joints at which something shows.
    """
    if item.index is None:
        return item
    best, healthy = item, 0.0
    if fit.problem.has_tolerance(item.index):
        if item.candidate.cause not in (*rig.shaped, *rig.reshaped) or item.candidate.joint not in loud:
            return item
        fit = Fit.of(fit.problem, fit.free, fixed=(item.index, np.zeros(len(item.candidate.parameters))))
        # What the healthy one explains has its own shape, whatever that of the faulty one.
        healthy = score_with(fit, item.candidate, rig.columns(item.candidate)) - item.score
    each = [(shape, rig.columns(shape)) for shape in rig.refinements(item.candidate)]
    for (shape, columns), score in zip(each, scores_with(fit, each), strict=True):
        if score - healthy > best.score:
            best = replace(item, candidate=shape, score=score - healthy, columns=columns)
    return best


def events_of(rig: Rig, fit: Fit) -> list[Scanned]:
    """What acts for a while, at the intervals where what is left is worst, the likeliest first.

    Where nothing names an event, a trial's noise has the power of what it leaves, in which its first rough interval may
    be nothing. So the one that stands out of noise as it should be is looked at in any case.
    """
    problem = fit.problem
    there = [problem.candidates[i] for i in fit.free]
    quiet, found, stands_out = Fit.of(problem.calm, fit.free), [], []
    for candidate in rig.transients([fit.remaining(t) for t in problem.trials]):
        # What is left of an event that is there is its form, and no other event.
        if not any(candidate.overlaps(other) for other in there):
            columns, spike = rig.columns(candidate), 1.0 if candidate.parameters[0].tolerance else 0.0
            found.append(Scanned(None, candidate, score_with(fit, candidate, columns, spike), columns))
            stands_out.append(score_with(quiet, candidate, columns, spike))
    if max(stands_out, default=0.0) > rules.NAMED_NATS:
        most = int(np.argmax(stands_out))
        found[most] = replace(found[most], loud=True)
    return sorted(found, key=lambda item: (not item.loud, -item.score))[: rules.WORST_EVENTS]


def log_bayes_factor(information: Array, score: Array, spike: float) -> float:
    """Of values that are normal with the best of some spreads, over values that are normal with the spread ``spike``.

    Args:
        information: about the values given all else, without their own prior, shape (k, k).
        score: its score vector, shape (k,).
        spike: spread of a healthy one; 0 where it has none.
    """
    lam, z = _visible(information, score)
    if not len(lam):
        return -np.inf
    slabs = likeliest_spread(information, score) * 2.0 ** np.arange(-2.0, 2.5)
    if spike > 0:
        slabs = np.maximum(slabs, rules.LEAST_SLAB * spike)
    return max(_log_evidence(lam, z, slab) for slab in slabs) - _log_evidence(lam, z, spike)


def likeliest_spread(information: Array, score: Array) -> float:
    """About the spread that makes values likeliest, arguments as of ``log_bayes_factor``; 0 where the data see none."""
    lam, z = _visible(information, score)
    return float(np.sqrt(np.mean((z / lam) ** 2))) if len(lam) else 0.0


def log_evidence(information: Array, score: Array, spread: float) -> float:
    """Of values that are normal with a spread, over none."""
    return _log_evidence(*_visible(information, score), spread)


def _visible(information: Array, score: Array) -> tuple[Array, Array]:
    """Information along the directions that the data see, and the score along them."""
    eigenvalues, vectors = np.linalg.eigh(information)
    keep = eigenvalues > rules.LEAST_INFORMATION
    return eigenvalues[keep], vectors[:, keep].T @ score


def _log_evidence(lam: Array, z: Array, spread: float) -> float:
    with_prior = 1.0 + lam * spread**2
    return float(0.5 * np.sum(z**2 * spread**2 / with_prior - np.log(with_prior)))
