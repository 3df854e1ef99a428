"""Look for causes: scan, sharpen the best, confirm on held-out trials, look again in what is left."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from discrepancy.held_out import confirmed, held_out_gains, shares
from discrepancy.problem import COMPLEXITY, Evidence, Fit, Problem
from discrepancy.rig import Candidate, Rig

Array = NDArray[np.float64]

SIGNIFICANT = -6.0
"""log10 p of the best of about a hundred candidates (a thousand intervals for a push) to be looked at."""
INTERVALS_LOG10 = 3.0
"""Intervals searched for a push, as powers of ten: its evidence pays for them."""
NEXT_SHARE = 0.25
"""A further cause has to take away this share of what the ones before it left."""
MOST_CAUSES = 3
CLEAN = 1.25
"""chi-square per number below which nothing is left to explain: clean recordings give 1.05 to 1.15."""
ENOUGH = 0.8
"""Share of the misfit that causes must explain on held-out trials, or the verdict is not ``explained``."""
RIVAL_SHARE = 0.5
"""A rival explains at least this share of what the best does."""
MOST_REJECTED = 4
LEADERS = 8


@dataclass(frozen=True, eq=False)
class Found:
    """A cause that the data speak for.

    Attributes:
        candidate: what and where, with its best shape.
        values, covariance: its parameters and their covariance, in their own units.
        evidence: when it was chosen.
        rivals: other candidates then, best first, with the gap of their score [nats].
        in_sample, held_out: share of the nominal model's misfit that it removes (see ``held_out.shares``).
        folds: gain of chi-square on every trial when fitted to the others.
    """

    candidate: Candidate
    values: Array
    covariance: Array
    evidence: Evidence
    rivals: tuple[tuple[Candidate, float], ...]
    in_sample: float
    held_out: float | None
    folds: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class Explanation:
    """What the search found.

    Attributes:
        found: causes in the order of discovery.
        rejected: significant candidates that held-out trials did not confirm.
        nominal: misfit of the nominal model, nothing off.
        before, after: misfit with tolerances alone, and with the causes as well.
        plain: misfit with the causes and no tolerances.
        samples: number of residuals.
        fit: the last fit.
        problem: the last problem (with the causes' shapes and residual).
        shared, local: displacements of the unknowns with the causes in the model.
    """

    found: tuple[Found, ...]
    rejected: tuple[Candidate, ...]
    nominal: float
    before: float
    after: float
    plain: float
    samples: int
    fit: Fit
    problem: Problem
    shared: Array
    local: tuple[Array, ...]

    @property
    def explained(self) -> float:
        """Share of the nominal model's misfit above clean data that the causes alone remove."""
        floor = min(self.plain, CLEAN * self.samples)
        return float(np.clip((self.nominal - self.plain) / max(self.nominal - floor, 1e-9), 0.0, 1.0))

    @property
    def clean(self) -> bool:
        """Whether what is left is noise, and tolerances used as they usually are."""
        return self.after <= CLEAN * self.samples and self.fit.strain[2] > SIGNIFICANT


def search(rig: Rig, most: int = MOST_CAUSES, progress: Callable[[str], object] | None = None) -> Explanation:
    """Explain the misfit of a rig's recordings by as few causes as possible.

    Args:
        rig: the rig.
        most: largest number of causes.
        progress: called with what is being done.
    """
    say = progress or (lambda what: None)
    candidates = rig.candidates()
    say("columns")
    problem = Problem.of(rig.rows(candidates), candidates)
    say("scan")
    free: list[int] = []
    found: list[Found] = []
    rejected: list[Candidate] = []
    fit = problem.fit()
    before, nominal = fit.misfit, problem.fit(background=False).misfit
    while len(found) < most:
        inflation = max(1.0, fit.misfit / (CLEAN * problem.samples))
        problem, evidence = _with_transients(rig, problem, fit, fit.evidence(inflation), inflation)
        barred = {c.key for c in rejected}
        evidence = [e for e in evidence if problem.candidates[e.index].key not in barred]
        leaders = _leaders(rig, problem, free, evidence, inflation)
        excess = max(fit.misfit - CLEAN * problem.samples, 0.0)
        leaders = [k for k in leaders if fit.misfit - k.misfit >= _least(k, excess, first=not found)]
        if not leaders:
            break
        best = leaders[0]
        candidate = best.candidate
        say(f"refit {candidate.label}")
        folds = held_out_gains(best.problem, free, best.evidence.index, candidate)
        if not confirmed(folds):
            rejected.append(candidate)
            if len(rejected) > MOST_REJECTED:
                break
            continue
        rivals = tuple(
            (k.candidate, 0.5 * (k.misfit - best.misfit))
            for k in leaders[1:]
            if fit.misfit - k.misfit > RIVAL_SHARE * (fit.misfit - best.misfit)
        )
        problem = best.problem
        before_it = list(free)
        free.append(best.evidence.index)
        problem, fit = _refit(rig, problem, free)
        in_sample, held_out = shares(problem, before_it, best.evidence.index)
        found.append(
            Found(
                candidate,
                np.zeros(0),
                np.zeros((0, 0)),
                best.evidence,
                rivals,
                in_sample,
                held_out,
                tuple(folds),
            )
        )
    start = Explanation(
        tuple(found),
        tuple(rejected),
        nominal,
        before,
        fit.misfit,
        0.0,
        problem.samples,
        fit,
        fit.problem,
        np.zeros(0),
        (),
    )
    return _finished(rig, start)


def refitted(rig: Rig, explanation: Explanation, free: Sequence[int]) -> Explanation:
    """The same explanation with other candidates (indices into its problem) in place of those found."""
    problem = explanation.problem
    for index in free:
        if index not in explanation.fit.free:
            problem = problem.with_unknowns(rig.unknowns(problem.candidates[index]))
    problem, fit = _refit(rig, problem, free)
    found = []
    for place, index in enumerate(free):
        candidate, old = problem.candidates[index], explanation.found[place]
        if candidate.key == old.candidate.key:
            found.append(old)
            continue
        others = [i for i in free if i != index]
        evidence = problem.fit(others).evidence_of(index) or old.evidence
        in_sample, held_out = shares(problem, others, index)
        rivals = tuple((old.candidate, -gap) if c.key == candidate.key else (c, gap) for c, gap in old.rivals)
        folds = tuple(held_out_gains(problem, others, index, candidate))
        found.append(replace(old, candidate=candidate, evidence=evidence, rivals=rivals, in_sample=in_sample,
                             held_out=held_out, folds=folds))  # fmt: skip
    return _finished(
        rig, replace(explanation, found=tuple(found), after=fit.misfit, fit=fit, problem=problem)
    )


def _finished(rig: Rig, explanation: Explanation) -> Explanation:
    """Values, covariances and unknowns from the last fit."""
    fit, problem = explanation.fit, explanation.problem
    results = []
    for index, item in zip(fit.free, explanation.found, strict=True):
        values, covariance = fit.part(index)
        units = problem.candidates[index].units
        results.append(replace(item, values=values * units, covariance=covariance * np.outer(units, units)))
    shared = fit.coefficients[: problem.shared]
    local = tuple(-fit.local(t)[: rig.local_unknowns] for t in range(len(problem.rows)))
    plain = problem.fit(fit.free, background=False).misfit
    return replace(explanation, found=tuple(results), plain=plain, shared=-shared, local=local)


def _least(leader: _Leader, excess: float, *, first: bool) -> float:
    """Least improvement of chi-square that is worth a cause: a share of what is left, if much is left."""
    if first and not leader.candidate.detail:
        return -np.inf
    return NEXT_SHARE * excess


def _log10_p(problem: Problem, evidence: Evidence) -> float:
    transient = bool(problem.candidates[evidence.index].detail)
    return evidence.log10_p + (INTERVALS_LOG10 if transient else 0.0)


def _with_transients(
    rig: Rig, problem: Problem, fit: Fit, evidence: list[Evidence], inflation: float
) -> tuple[Problem, list[Evidence]]:
    """Add the best transient to the problem."""
    best: tuple[float, Problem] | None = None
    for candidate in rig.transients([fit.remaining(t) for t in range(len(problem.rows))]):
        if any(c.detail and dict(c.detail) == dict(candidate.detail) for c in problem.candidates):
            continue
        wider = problem.extended(candidate, rig.columns(candidate))
        last = len(wider.candidates) - 1
        misfit = wider.fit([*fit.free, last]).misfit
        if best is None or misfit < best[0]:
            best = (misfit, wider)
    if best is None:
        return problem, evidence
    return best[1], best[1].fit(fit.free).evidence(inflation)


@dataclass(frozen=True, eq=False)
class _Leader:
    """A candidate at its best: with its best shape, and with what it leaves open.

    Attributes:
        evidence: that its parameters leave their tolerance.
        problem: the problem with that shape and those unknowns.
        misfit: chi-square with its parameters free, plus the penalty for them and for its unknowns.
    """

    evidence: Evidence
    problem: Problem
    misfit: float

    @property
    def candidate(self) -> Candidate:
        return self.problem.candidates[self.evidence.index]


def _leaders(
    rig: Rig, problem: Problem, free: Sequence[int], evidence: Sequence[Evidence], inflation: float
) -> list[_Leader]:
    """Significant candidates at their best, the least misfit first."""
    significant = [e for e in evidence if _log10_p(problem, e) <= SIGNIFICANT][:LEADERS]
    leaders = []
    for first in significant:
        index = first.index
        best: _Leader | None = None
        start = problem.candidates[index]
        for shape in (start, *rig.refinements(start)):
            best = _better(rig, problem, free, index, shape, best, inflation)
        for shape in rig.refinements(best.candidate, finer=True) if best is not None else []:
            best = _better(rig, problem, free, index, shape, best, inflation)
        if best is None or _log10_p(best.problem, best.evidence) > SIGNIFICANT:
            continue
        values, covariance = best.problem.fit([*free, index]).part(index)
        units = best.candidate.units
        if rig.possible(best.candidate, values * units, covariance * np.outer(units, units)):
            leaders.append(best)
    return sorted(leaders, key=lambda leader: leader.misfit)


def _better(
    rig: Rig,
    problem: Problem,
    free: Sequence[int],
    index: int,
    shape: Candidate,
    best: _Leader | None,
    inflation: float,
) -> _Leader | None:
    """The better of a candidate with a given shape and the best so far."""
    changed = problem
    if shape is not problem.candidates[index]:
        changed = problem.with_columns(index, shape, rig.columns(shape))
    unknowns = [] if shape.detail else rig.unknowns(shape)
    if unknowns:
        changed = changed.with_unknowns(unknowns)
    judged = changed.fit(free).evidence_of(index, inflation)
    if judged is None:
        return best
    count = judged.parameters + sum(u.shape[2] for u in unknowns)
    penalty = COMPLEXITY * np.log(problem.samples) * count
    misfit = changed.fit([*free, index]).misfit + penalty
    return _Leader(judged, changed, misfit) if best is None or misfit < best.misfit else best


def _refit(rig: Rig, problem: Problem, free: Sequence[int], rounds: int = 3) -> tuple[Problem, Fit]:
    """Gauss-Newton on causes and unknowns: exact residuals, the catalogue's columns."""
    fit = problem.fit(free)
    for _ in range(rounds):
        coefficients = fit.coefficients
        shared = coefficients[: problem.shared]
        local = [fit.local(t) for t in range(len(problem.rows))]
        own = rig.local_unknowns
        active = [(problem.candidates[i], fit.part(i)[0] * problem.candidates[i].units) for i in free]
        exact = rig.residual(-shared, [-x[:own] for x in local], active)
        # The problem counts total values, so what its columns stand for is added back.
        back = []
        for t, r in enumerate(exact):
            total = (
                r
                + problem.raw[t][..., : problem.shared] @ shared
                + problem.local[t][..., :own] @ local[t][:own]
            )
            for i in free:
                total = total + problem.raw[t][..., problem.spans[i]] @ fit.part(i)[0]
            back.append(total)
        moved = problem.with_residual(back)
        new = moved.fit(free)
        if new.misfit > 1.5 * fit.misfit + problem.samples:  # diverges: the linear answer is the better one
            break
        problem, fit = moved, new
    return problem, fit
