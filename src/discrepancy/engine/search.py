"""Look for causes: scan, sharpen the best, confirm on held-out trials, look again in what is left."""

from collections.abc import Callable, Collection, Sequence

from discrepancy import rules
from discrepancy.engine.explanation import Explanation, Named
from discrepancy.engine.held_out import confirmed, held_out_gains
from discrepancy.engine.imitation import imitated
from discrepancy.engine.leaders import Leader, in_best_shapes, leaders, with_transient
from discrepancy.engine.refit import explanation_of, idlest, refit
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
    named: list[Named] = []
    rejected: list[Candidate] = []
    fit = Fit.of(problem)
    before, nominal = fit.misfit, Fit.of(problem, background=False).misfit
    while len(named) < most:
        fit = Fit.of(in_best_shapes(rig, fit), fit.free)
        ranked = _worth_naming(rig, fit, rejected)
        if not ranked:
            break
        best = ranked[0]
        say(f"refit {best.candidate.label}")
        folds = held_out_gains(best.problem, fit.free, best.index)
        if not confirmed(folds) or imitated(rig, best, fit.free):
            rejected.append(best.candidate)
            if len(rejected) > rules.MOST_REJECTED:
                break
            continue
        rivals = _rivals(fit, ranked)
        fit = refit(rig, best.problem, [*fit.free, best.index])
        new = Named(
            index=best.index,
            candidate=best.candidate,
            evidence=best.evidence,
            rivals=rivals,
            folds=tuple(folds),
        )
        # What was named first may have stood in for what was found since.
        idle = idlest(fit, named)
        named.append(new)
        if idle is not None:
            named.remove(idle)
            rejected.append(idle.candidate)
            fit = refit(rig, fit.problem, [cause.index for cause in named])
    return explanation_of(rig, fit, named, rejected, nominal=nominal, before=before)


def _worth_naming(rig: Rig, fit: Fit, rejected: Collection[Candidate]) -> list[Leader]:
    """Significant candidates that are worth naming beside those that are free, the best first."""
    # A transient stays only if what is named is judged with it in the model.
    wider = with_transient(rig, fit)
    barred = {candidate.key for candidate in rejected}
    evidence = [
        e for e in wider.evidence(fit.inflation) if wider.problem.candidates[e.index].key not in barred
    ]
    ranked = leaders(rig, wider, evidence, fit.inflation)
    return [k for k in ranked if worth_naming(rig, fit, k) and is_another(fit, k)]


def _rivals(fit: Fit, ranked: Sequence[Leader]) -> tuple[tuple[Candidate, float], ...]:
    """Those that explain much of what the best does, and by how much their score is worse [nats]."""
    best, *others = ranked
    enough = rules.RIVAL_SHARE * (fit.misfit - best.misfit)
    return tuple(
        (k.candidate, 0.5 * (k.misfit - best.misfit)) for k in others if fit.misfit - k.misfit > enough
    )
