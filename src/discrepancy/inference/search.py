"""The likeliest hypothesis: causes are added, exchanged and taken away while that makes it likelier."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from discrepancy import rules
from discrepancy.candidate import Candidate
from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.inference.learn import worth_spreads
from discrepancy.inference.other_forms import beside_other_forms
from discrepancy.inference.probability import probability
from discrepancy.inference.propose import Proposed, proposals
from discrepancy.inference.refit import exact
from discrepancy.inference.remainder import is_noise, nats_left, share_left, unlisted_nats
from discrepancy.inference.shape.reshape import reshaped, settled_shape
from discrepancy.inference.twins import twins
from discrepancy.least_squares.problem import Problem
from discrepancy.rig import Rig


@dataclass(frozen=True, eq=False)
class Rival:
    """What could be there instead of a cause.

    Attributes:
        candidate: the other; None for nothing at all in its place.
        gap: by how much the cause is likelier [nats].
    """

    candidate: Candidate | None
    gap: float


@dataclass(frozen=True, eq=False)
class Searched:
    """The likeliest hypothesis found.

    Attributes:
        nothing: the hypothesis that nothing is there beyond its kind's spread.
        best: the likeliest.
        rivals: of every cause of the best, the likeliest first.
        rig: the rig, linear around where the search found it.
    """

    rig: Rig
    nothing: Hypothesis
    best: Hypothesis
    rivals: tuple[tuple[Rival, ...], ...]


def search(
    rig: Rig,
    most: int = rules.MOST_CAUSES,
    progress: Callable[[str], object] | None = None,
    odds: float = rules.PRIOR_ODDS,
    first: Callable[[Searched], Searched | None] | None = None,
) -> Searched:
    """Find what is most probably there.

    Args:
        rig: the rig.
        most: largest number of causes.
        progress: called with what is being done.
        odds: of any cause being there before the data are seen.
        first: what is to be there instead of the first step, a cause or one that healthy ones have, too; asked once it
            is taken; None where that is to stay.
    """
    say = progress or (lambda what: None)
    rig, nothing = _based(rig, say)
    nothing = replace(nothing, learnt=replace(nothing.learnt, problem=replace(nothing.problem, odds=odds)))
    say("scan")
    return continued(Searched(rig, nothing, nothing, ()), most, say, first)


def continued(
    searched: Searched, most: int, say: Callable[[str], object],
    first: Callable[[Searched], Searched | None] | None = None,
) -> Searched:  # fmt: skip
    """Go on from what was found, until nothing pays; ``first`` as of ``search``."""
    rig, nothing, best = searched.rig, searched.nothing, searched.best
    rivals = dict(zip(best.free, map(list, searched.rivals), strict=True))
    doubtful = 0
    while len(best.free) < most and doubtful < rules.DOUBTFUL:
        added = _added(best, proposals(rig, best))
        if added is None:
            break
        say(f"refit {added.causes[-1].label}")
        little = added.score - best.score < rules.LITTLE_SHARE * nats_left(best)
        added = exact(rig, added, nothing)
        if tolerated := _tolerated(best, added):
            found, beside = settled(rig, tolerated, nothing)
            if found.score - best.score < rules.SHAPE_NATS:
                break
        else:
            found, beside = settled(rig, added, nothing)
            if _gained(best, found) < _needed(best, found):
                break  # what pays where all is linear need not do so where it is exact
        best, rivals = found, beside
        if first is not None:
            instead = first(Searched(rig, nothing, best, tuple(tuple(rivals.get(i, ())) for i in best.free)))
            first = None
            if instead is not None:
                best, rivals = (
                    instead.best,
                    dict(zip(instead.best.free, map(list, instead.rivals), strict=True)),
                )
                continue
        if tolerated:
            continue
        last = best.free[-1] if best.free else None
        likely = last is None or _law_holds(rig, best, last)
        doubtful = doubtful + 1 if little and not likely else 0
    return Searched(rig, nothing, best, tuple(tuple(rivals.get(i, ())) for i in best.free))


def _added(base: Hypothesis, proposed: Proposed) -> Hypothesis | None:
    """The proposal to go on with: the likeliest; None where it does not pay.

    Where what is left is no noise a law that healthy ones have, too, may account for it.
    """
    best, open_ = proposed.best, proposed.open
    if best is None or best.score - base.score >= _needed(base, best) or _tolerated(base, best):
        return best
    if open_ is None or is_noise(base.fit.chi2, base.problem.samples, unlisted_nats(base)):
        return None
    return open_ if _tolerated(base, open_) else None


def _tolerated(base: Hypothesis, added: Hypothesis) -> Hypothesis | None:
    """The hypothesis that the last cause of ``added`` is there, but does not stand out of how its kind scatters.

    None where it stands out, or where its law tells no more than straight columns.
    """
    tolerated = added.tolerating(added.free[-1])
    if tolerated is None or _beyond(added, added.free[-1], tolerated) >= _needed(tolerated, added):
        return None
    return tolerated if tolerated.score - base.score >= rules.SHAPE_NATS else None


def _beyond(there: Hypothesis, index: int, tolerated: Hypothesis) -> float:
    """By how much a cause is likelier than that it is as far off as its kind scatters [nats].

    What it leaves open is in both, so nothing of that is to be allowed for.
    """
    return there.score + there.allowed.get(index, 0.0) - tolerated.score


def _healthy(best: Hypothesis, index: int, less: Hypothesis, judged: Hypothesis) -> tuple[Hypothesis, float]:
    """What is likeliest without one of the causes, and by how much that is less likely [nats].

    Args:
        best: with the cause.
        index: which.
        less: without it.
        judged: with it, beside other forms of the others.
    """
    tolerated, gap = best.tolerating(index), judged.score - less.score
    if tolerated is not None and tolerated.score > less.score:
        beyond = _beyond(best, index, tolerated)
        if beyond < gap:
            return tolerated, beyond
    return less, gap


def _gained(base: Hypothesis, more: Hypothesis) -> float:
    """By how much a hypothesis with another cause is likelier [nats].

    A kind that scatters explains a fault of its own by straight columns. Where a cause takes the place of such a
    scatter, both count with the residual at which the cause is exact.
    """
    known = {cause.key for cause in base.causes}
    new = [i for i, cause in zip(more.free, more.causes, strict=True) if cause.key not in known]
    if len(new) == 1 and _wide(base, rules.HELD_FACTOR) - _wide(more, rules.HELD_FACTOR):
        return more.score - more.without(new[0]).score
    return more.score - base.score


def _needed(base: Hypothesis, more: Hypothesis) -> float:
    """By how many nats a hypothesis with one cause more must be likelier.

    A scatter of one kind alone, all others as they should be, is no healthy machine either: as soon as one of its
    places, or of a kind with the same trace, is likelier than that, it is named. Where several kinds scatter, all is
    off, and it has to stand out.
    """
    if not _wide(base, rules.SCATTER_FACTOR):
        return rules.NAMED_NATS
    # From three places a spread is known to a half: only one that the data want is one.
    worth = worth_spreads(base.learnt, _wide(base, rules.HELD_FACTOR))
    off = [kind for kind, nats in worth.items() if nats > rules.NAMED_NATS]
    if len(off) != 1 or not _alike(base.problem, off[0]) & {cause.cause for cause in more.causes}:
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


def _law_holds(rig: Rig, hypothesis: Hypothesis, index: int) -> bool:
    """Whether a cause is likelier than something unlisted that looks like it."""
    doubt = rig.law_doubt(hypothesis.problem.candidates[index])
    return probability([], share_left(hypothesis, index), doubt) >= rules.LEAST_PROBABILITY


def _based(rig: Rig, say: Callable[[str], object]) -> tuple[Rig, Hypothesis]:
    """The rig linear around where it is, and the hypothesis that nothing is there beyond its kind's spread."""
    nothing = _nothing(rig, say)
    for _ in range(rules.BASE_ROUNDS - 1):
        moved = rig.relinearised(nothing)
        if moved is None:
            break
        say("linearise")
        rig = moved
        del nothing, moved  # for the sake of memory
        nothing = _nothing(rig, say)
    return rig, exact(rig, nothing, nothing) if rig.curved else nothing


def _nothing(rig: Rig, say: Callable[[str], object]) -> Hypothesis:
    say("columns")
    candidates = rig.candidates()
    return Hypothesis.of(Problem.of(rig.rows(candidates), candidates), ())


def settled(rig: Rig, best: Hypothesis, nothing: Hypothesis) -> tuple[Hypothesis, dict[int, list[Rival]]]:
    """Exchange and take away causes until none is likelier, and what could be there instead of each."""
    rivals: dict[int, list[Rival]] = {}
    for _ in range(rules.EXCHANGES):
        changed = False
        if rig.layered:
            best = reshaped(rig, best, nothing)
        for index in best.free:
            if best.problem.candidates[index].transient:  # its interval was told beside what was known then
                best = settled_shape(rig, best, index)
        for index in best.free:
            less = best.without(index)
            # Its own loss to forms of the others is judged here, but counted once: not theirs to its forms, too.
            judged = beside_other_forms(rig, best, index, less)
            healthy, gap = _healthy(best, index, less, judged)
            if gap < _needed(healthy, judged):
                best, changed = exact(rig, healthy, nothing), True
                break
            candidate = best.problem.candidates[index]
            # Its own shape may be another beside what was found since.
            others = proposals(rig, less, events=candidate.transient is None, narrow=False, known=candidate)
            rivals[index] = [
                Rival(other, judged.score - score)
                for other, score in others.scores
                if other.key != candidate.key
            ]
            rivals[index].append(Rival(None, gap))
            if others.best is not None and others.best.score > judged.score + rules.EXCHANGED_NATS:
                other = exact(rig, others.best, nothing)
                if other.score > best.score:
                    best, changed = other, True
                    break
                # Less likely where it is exact; and none of the others was likelier than that one.
                least = best.score - other.score
                rivals[index] = [
                    rival if rival.candidate is None else replace(rival, gap=max(rival.gap, least))
                    for rival in rivals[index]
                ]
            elif others.other is not None and others.other.score > judged.score - rules.EXCHANGED_NATS:
                # Equally likely by straight columns; exact ones may part them.
                other = exact(rig, others.other, nothing)
                if other.score > best.score + rules.EXCHANGED_NATS:
                    best, changed = other, True
                    break
        if not changed:
            break
    for index in set(best.free) - set(rivals):  # exchanged in the last round
        rivals[index] = [Rival(None, best.score - best.without(index).score)]
    return best, rivals
