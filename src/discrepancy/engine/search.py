"""Look for causes: scan, sharpen the best, confirm on held-out trials, look again in what is left."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np

from discrepancy import rules
from discrepancy.engine.best_shape import covariance_with_shape
from discrepancy.engine.explanation import Explanation, Found
from discrepancy.engine.held_out import confirmed, held_out_gains, shares
from discrepancy.engine.imitation import imitated
from discrepancy.engine.leaders import in_best_shapes, leaders, log10_p, with_transients
from discrepancy.engine.worth import is_another, worth_naming
from discrepancy.least_squares.fit import Fit
from discrepancy.least_squares.problem import Problem
from discrepancy.rig import Candidate, Rig


def search(
    rig: Rig, most: int = rules.MOST_CAUSES, progress: Callable[[str], object] | None = None
) -> Explanation:
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
        inflation = max(1.0, fit.misfit / (rules.CLEAN_CHI2_PER_N * problem.samples))
        problem = in_best_shapes(rig, problem, fit)
        fit = problem.fit(free)
        # A transient stays only if what is named is judged with it in the model.
        wider, evidence = with_transients(rig, problem, fit, fit.evidence(inflation), inflation)
        barred = {c.key for c in rejected}
        evidence = [e for e in evidence if wider.candidates[e.index].key not in barred]
        ranked = leaders(rig, wider, free, evidence, inflation)
        ranked = [k for k in ranked if worth_naming(rig, fit, k, first=not found) and is_another(fit, k)]
        if not ranked:
            break
        best = ranked[0]
        candidate = best.candidate
        say(f"refit {candidate.label}")
        folds = held_out_gains(best.problem, free, best.evidence.index, candidate)
        if not confirmed(folds) or imitated(rig, best, free):
            rejected.append(candidate)
            if len(rejected) > rules.MOST_REJECTED:
                break
            continue
        rivals = tuple(
            (k.candidate, 0.5 * (k.misfit - best.misfit))
            for k in ranked[1:]
            if fit.misfit - k.misfit > rules.RIVAL_SHARE * (fit.misfit - best.misfit)
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
        for place in _idle(problem, free, range(len(free) - 1)):
            # What was named first may have stood in for what was found since.
            rejected.append(found.pop(place).candidate)
            del free[place]
            problem, fit = _refit(rig, problem, free)
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
        values = fit.part(index)[0] * problem.candidates[index].units
        results.append(replace(item, values=values, covariance=covariance_with_shape(rig, fit, index)))
    shared = fit.coefficients[: problem.shared]
    local = tuple(-fit.local(t)[: rig.local_unknowns] for t in range(len(problem.rows)))
    plain = problem.fit(fit.free, background=False).misfit
    return replace(explanation, found=tuple(results), plain=plain, shared=-shared, local=local)


def without_idle(rig: Rig, explanation: Explanation) -> tuple[Explanation, list[int]]:
    """Drop causes that tell nothing beside the others, such as what was left by a cause that has been replaced since.

    Returns:
        The explanation by the rest, and their places in the old one.
    """
    places = list(range(len(explanation.found)))
    while idle := _idle(explanation.problem, explanation.fit.free, range(len(explanation.fit.free))):
        left = [k for k in range(len(explanation.found)) if k not in idle]
        free = [explanation.fit.free[k] for k in left]
        places = [places[k] for k in left]
        rest = replace(explanation, found=tuple(explanation.found[k] for k in left))
        explanation = refitted(rig, rest, free)
    return explanation, places


def _idle(problem: Problem, free: Sequence[int], places: Iterable[int]) -> list[int]:
    """Of the causes at some places the one that tells least beside all others, if that is too little to name it."""
    weakest: tuple[float, int] | None = None
    for place in places:
        index = free[place]
        others = problem.fit([i for i in free if i != index])
        inflation = max(1.0, others.misfit / (rules.CLEAN_CHI2_PER_N * problem.samples))
        judged = others.evidence_of(index, inflation)
        told = 0.0 if judged is None else log10_p(problem, judged)
        if told > rules.SIGNIFICANT_LOG10_P and (weakest is None or told > weakest[0]):
            weakest = told, place
    return [] if weakest is None else [weakest[1]]


def _refit(
    rig: Rig, problem: Problem, free: Sequence[int], rounds: int = rules.REFIT_ROUNDS
) -> tuple[Problem, Fit]:
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
        if new.misfit > rules.DIVERGED_RATIO * fit.misfit + problem.samples:
            break  # it diverges: the linear answer is the better one
        problem, fit = moved, new
    return problem, fit
