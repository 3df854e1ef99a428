"""Fit chosen causes again: exact residuals, other causes in their places, causes that tell nothing any more."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

from discrepancy import rules
from discrepancy.engine.best_shape import covariance_with_shape
from discrepancy.engine.explanation import Explanation, Found, Named
from discrepancy.engine.held_out import held_out_gains, shares
from discrepancy.engine.leaders import log10_p
from discrepancy.least_squares.fit import Fit
from discrepancy.least_squares.problem import Problem
from discrepancy.rig import Candidate, Rig

N = TypeVar("N", bound=Named)


def refit(rig: Rig, problem: Problem, free: Sequence[int], rounds: int = rules.REFIT_ROUNDS) -> Fit:
    """Gauss-Newton on causes and unknowns: exact residuals, the catalogue's columns."""
    fit = Fit.of(problem, free)
    for _ in range(rounds):
        own, trials = rig.local_unknowns, range(len(fit.problem.rows))
        local = [fit.local(t) for t in trials]
        exact = rig.residual(-fit.shared, [-x[:own] for x in local], fit.active)
        # The problem counts total values, so what its columns stand for is added back.
        back = []
        for t, total in zip(trials, exact, strict=True):
            raw = fit.problem.raw[t]
            total = (
                total
                + raw[..., : fit.problem.shared] @ fit.shared
                + fit.problem.local[t][..., :own] @ local[t][:own]
            )
            for i in free:
                total = total + raw[..., fit.problem.spans[i]] @ fit.part(i)[0]
            back.append(total)
        new = Fit.of(fit.problem.with_residual(back), free)
        if new.misfit > rules.DIVERGED_RATIO * fit.misfit + problem.samples:
            break  # it diverges: the linear answer is the better one
        fit = new
    return fit


def explanation_of(
    rig: Rig,
    fit: Fit,
    named: Sequence[Named],
    rejected: Sequence[Candidate],
    *,
    nominal: float,
    before: float,
) -> Explanation:
    """The explanation by named causes, all of which are free in the last fit.

    Args:
        rig: for columns of other shapes.
        fit: the last fit.
        named: in the order of discovery.
        rejected, nominal, before: as of ``Explanation``.
    """
    found = []
    removed = shares(fit.problem, [cause.index for cause in named])
    for cause, (in_sample, held_out) in zip(named, removed, strict=True):
        values = fit.part(cause.index)[0] * cause.candidate.units
        known = {key: value for key, value in vars(cause).items() if key in Named.__dataclass_fields__}
        covariance = covariance_with_shape(rig, fit, cause.index)
        found.append(
            Found(**known, values=values, covariance=covariance, in_sample=in_sample, held_out=held_out)
        )
    return Explanation(
        found=tuple(found),
        rejected=tuple(rejected),
        nominal=nominal,
        before=before,
        after=fit.misfit,
        plain=Fit.of(fit.problem, fit.free, background=False).misfit,
        fit=fit,
        shared=-fit.shared,
        local=tuple(-fit.local(t)[: rig.local_unknowns] for t in range(len(fit.problem.rows))),
    )


def only(rig: Rig, explanation: Explanation, kept: Sequence[Named]) -> Explanation:
    """The same explanation without the causes that are not kept."""
    fit = refit(rig, explanation.problem, [cause.index for cause in kept])
    return _again(rig, explanation, fit, kept)


def with_rival(rig: Rig, explanation: Explanation, problem: Problem, cause: Named, index: int) -> Explanation:
    """The same explanation with a rival in the place of a cause.

    Args:
        rig: the rig.
        explanation: with the cause.
        problem: with the rival's best columns.
        cause: one of those found.
        index: of the rival in the problem.
    """
    problem = problem.with_unknowns(rig.unknowns(problem.candidates[index]))
    free = [index if other is cause else other.index for other in explanation.found]
    fit = refit(rig, problem, free)
    rival, others = fit.problem.candidates[index], [i for i in free if i != index]
    named = replace(
        cause,
        index=index,
        candidate=rival,
        evidence=Fit.of(fit.problem, others).evidence_of(index) or cause.evidence,
        rivals=tuple((cause.candidate, -gap) if c.key == rival.key else (c, gap) for c, gap in cause.rivals),
        folds=tuple(held_out_gains(fit.problem, others, index)),
    )
    return _again(rig, explanation, fit, [named if other is cause else other for other in explanation.found])


def _again(rig: Rig, explanation: Explanation, fit: Fit, named: Sequence[Named]) -> Explanation:
    nominal, before = explanation.nominal, explanation.before
    return explanation_of(rig, fit, named, explanation.rejected, nominal=nominal, before=before)


def without_idle(rig: Rig, explanation: Explanation) -> Explanation:
    """Drop causes that tell nothing beside the others, such as what a cause left that has been replaced since."""
    while (idle := idlest(explanation.fit, explanation.found)) is not None:
        explanation = only(rig, explanation, [cause for cause in explanation.found if cause is not idle])
    return explanation


def idlest(fit: Fit, named: Sequence[N]) -> N | None:
    """Of named causes the one that tells least beside all that are free, if that is too little to name it."""
    weakest: tuple[float, N] | None = None
    for cause in named:
        others = Fit.of(fit.problem, [i for i in fit.free if i != cause.index])
        judged = others.evidence_of(cause.index, others.inflation)
        told = 0.0 if judged is None else log10_p(fit.problem, judged)
        if told > rules.SIGNIFICANT_LOG10_P and (weakest is None or told > weakest[0]):
            weakest = told, cause
    return None if weakest is None else weakest[1]
