"""Whether a cause more is worth it: beside how its kind scatters, and by how much it is to be likelier."""

from __future__ import annotations

from discrepancy import rules
from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.inference.learn import worth_spreads
from discrepancy.inference.twins import twins
from discrepancy.least_squares.problem import Problem


def tolerated(base: Hypothesis, added: Hypothesis) -> Hypothesis | None:
    """The hypothesis that the last cause of ``added`` is there, but does not stand out of how its kind scatters.

    None where it stands out, or where its law tells no more than straight columns.
    """
    scattered = added.tolerating(added.free[-1])
    if scattered is None or _beyond(added, added.free[-1], scattered) >= needed(scattered, added):
        return None
    return scattered if scattered.score - base.score >= rules.SHAPE_NATS else None


def _beyond(there: Hypothesis, index: int, scattered: Hypothesis) -> float:
    """By how much a cause is likelier than that it is as far off as its kind scatters [nats].

    What it leaves open is in both, so nothing of that is to be allowed for.
    """
    return there.score + there.allowed.get(index, 0.0) - scattered.score


def healthy(best: Hypothesis, index: int, less: Hypothesis, judged: Hypothesis) -> tuple[Hypothesis, float]:
    """What is likeliest without one of the causes, and by how much that is less likely [nats].

    Args:
        best: with the cause.
        index: which.
        less: without it.
        judged: with it, beside other forms of the others.
    """
    scattered, gap = best.tolerating(index), judged.score - less.score
    if scattered is not None and scattered.score > less.score:
        beyond = _beyond(best, index, scattered)
        if beyond < gap:
            return scattered, beyond
    return less, gap


def gained(base: Hypothesis, more: Hypothesis) -> float:
    """By how much a hypothesis with another cause is likelier [nats].

    A kind that scatters explains a fault of its own by straight columns. Where a cause is of such a kind, or takes the
    place of its scatter, both count with the residual at which the cause is exact.
    """
    known = {cause.key for cause in base.causes}
    new = [i for i, cause in zip(more.free, more.causes, strict=True) if cause.key not in known]
    if len(new) == 1:
        wide = _wide(base, rules.HELD_FACTOR)
        if more.problem.candidates[new[0]].cause in wide or wide - _wide(more, rules.HELD_FACTOR):
            return more.score - more.without(new[0]).score
    return more.score - base.score


def needed(base: Hypothesis, more: Hypothesis) -> float:
    """By how many nats a hypothesis with one cause more must be likelier.

    A scatter of one kind alone, all others as they should be, is no healthy machine either: as soon as one of its
    places, or of a kind with the same trace, or a cause beside which nothing scatters, is likelier than that, it is
    named. Where several kinds scatter, all is off, and it has to stand out. Than that all are within tolerance it is
    likelier by ``NAMED_NATS`` in any case.
    """
    if not _wide(base, rules.HELD_FACTOR):
        return rules.NAMED_NATS
    # From three places a spread is known to a half: only one that the data want is one.
    worth = worth_spreads(base.learnt, _wide(base, rules.HELD_FACTOR))
    off = [kind for kind, nats in worth.items() if nats > rules.NAMED_NATS]
    if len(off) != 1:
        return rules.NAMED_NATS
    alike = _alike(base.problem, off[0]) & {cause.cause for cause in more.causes}
    if not alike and _wide(more, rules.HELD_FACTOR):
        return rules.NAMED_NATS
    if _wide(more, rules.SCATTER_FACTOR):
        return rules.NAMED_NATS
    return max(0.0, rules.NAMED_NATS - worth[off[0]])


def _alike(problem: Problem, kind: str) -> set[str]:
    """A kind and those that leave the same trace."""
    kinds = {c.cause for i, c in enumerate(problem.candidates) if problem.has_tolerance(i)}
    return {kind}.union(*(pair for pair in twins(problem, kinds) if kind in pair))


def _wide(hypothesis: Hypothesis, factor: float) -> set[str]:
    """Kinds that scatter by so many tolerances."""
    problem = hypothesis.problem
    return {
        candidate.cause
        for index, candidate in enumerate(problem.candidates)
        if index not in hypothesis.free and problem.has_tolerance(index)
        if problem.spread[problem.columns_of(index)].max() >= factor
    }
