"""The likeliest hypothesis: causes are added, exchanged and taken away while that makes it likelier."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from discrepancy import rules
from discrepancy.candidate import Candidate
from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.inference.other_forms import beside_other_forms
from discrepancy.inference.pays import gained, healthy, needed, tolerated
from discrepancy.inference.probability import probability
from discrepancy.inference.propose import Offer, Proposed, proposals
from discrepancy.inference.refit import exact, near
from discrepancy.inference.remainder import is_noise, nats_left, share_left, trace_nats, unlisted_nats
from discrepancy.inference.shape.reshape import reshaped, settled_shape
from discrepancy.least_squares.problem import Key, Problem
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
    until: Callable[[Hypothesis], bool] | None = None,
) -> Searched:  # fmt: skip
    """Go on from what was found, until nothing pays.

    Args:
        searched: what was found.
        most, say, first: as of ``search``.
        until: asked of every step before it is refined: whether it is the last, and stays as it is; None for no.
    """
    rig, nothing, best = searched.rig, searched.nothing, searched.best
    rivals = dict(zip(best.free, map(list, searched.rivals), strict=True))
    doubtful, refused, but = 0, 0, set[Key]()
    while len(best.free) < most and doubtful < rules.DOUBTFUL and refused < rules.REFUSED:
        proposed = proposals(rig, best, nothing=nothing, but=but)
        added, shapes = _added(best, proposed), proposed.shapes
        del proposed  # for the sake of memory
        if added is None:
            break
        if until is not None and until(added):
            best = added
            break
        say(f"refit {added.causes[-1].label}")
        little = added.score - best.score < rules.LITTLE_SHARE * nats_left(best)
        added, last = exact(rig, added, nothing), added.causes[-1]
        if scattered := tolerated(best, added):
            if _form_of_a_fault(rig, best, last, scattered):
                refused, but = (
                    refused + 1,
                    but | {c.key for c in best.problem.candidates if c.cause == last.cause},
                )
                continue
            found, beside = settled(rig, scattered, nothing)
            pays = found.score - best.score >= rules.SHAPE_NATS
        else:
            found, beside = settled(rig, added, nothing, shapes)
            pays = gained(best, found) >= needed(best, found)
        if not pays:  # where all is linear it did, which need not be so where it is exact
            if last.transient:
                break
            refused, but = refused + 1, but | {last.key}
            continue
        refused, but = 0, set()
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
        if scattered:
            continue
        newest = best.free[-1] if best.free else None
        likely = newest is None or _law_holds(rig, best, newest)
        doubtful = doubtful + 1 if little and not likely else 0
    return Searched(rig, nothing, best, tuple(tuple(rivals.get(i, ())) for i in best.free))


def _added(base: Hypothesis, proposed: Proposed) -> Hypothesis | None:
    """The proposal to go on with: the likeliest; None where it does not pay.

    Where what is left is no noise a law that healthy ones have, too, may account for it.
    """
    best, open_ = proposed.best, proposed.open
    if best is None or best.score - base.score >= needed(base, best) or tolerated(base, best):
        return best
    if open_ is None or is_noise(base.fit.chi2, base.problem.samples, unlisted_nats(base)):
        return None
    return open_ if tolerated(base, open_) else None


def _but(shapes: Mapping[Key, Candidate] | None, cause: Candidate) -> dict[Key, Candidate]:
    """Shapes of others: a cause's own may be settled further in the noise that is left with it."""
    return {key: shape for key, shape in (shapes or {}).items() if key != cause.key}


def _likelier(other: Hypothesis, best: Hypothesis, by: float = 0.0) -> bool:
    """Whether another is to be there instead, by the data alone and beside what other forms of the rest could do.

    What each is charged for these is of when it was added, beside what was known then: no reason alone for the other.
    Nor is a fit alone that is mostly theirs, or the search would end where it had gone on.
    """
    return other.uncharged > best.uncharged + by and other.score > best.score + by


def _gap(rig: Rig, best: Hypothesis, index: int, less: Hypothesis, judged: Hypothesis, other: Offer) -> float:
    """By how much a cause is likelier than another in its place [nats].

    Where other forms of the rest matter for one of the two alone, that is no reason for the other: both are judged
    beside what matters for both, and share the probability where nothing else parts them.
    """
    gap = judged.score - other.score
    if rig.charged_alike(best.problem.candidates[index], other.candidate):
        return gap
    alike = beside_other_forms(rig, best, index, less, other.candidate).score - other.alike
    return min(gap, max(alike, 0.0))


def _law_holds(rig: Rig, hypothesis: Hypothesis, index: int) -> bool:
    """Whether a cause is likelier than something unlisted that looks like it."""
    doubt = rig.law_doubt(hypothesis.problem.candidates[index])
    return probability([], share_left(hypothesis, index), doubt) >= rules.LEAST_PROBABILITY


def _form_of_a_fault(rig: Rig, base: Hypothesis, cause: Candidate, scattered: Hypothesis) -> bool:
    """Whether a kind that scatters in another shape is what the law of a named fault of that kind may leave."""
    worth = [
        rig.law_doubt(other).share ** 2 * trace_nats(base, index)
        for index, other in zip(base.free, base.causes, strict=True)
        if other.cause == cause.cause
    ]
    return bool(worth) and scattered.score - base.score < max(worth)


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


def settled(
    rig: Rig, best: Hypothesis, nothing: Hypothesis, shapes: Mapping[Key, Candidate] | None = None
) -> tuple[Hypothesis, dict[int, list[Rival]]]:
    """Exchange and take away causes until none is likelier, and what could be there instead of each.

    Args:
        rig: for columns.
        best: what is there.
        nothing: the hypothesis that nothing is.
        shapes: what was sought in place of the last of the causes, in these shapes; None where it was not.
    """
    rivals: dict[int, list[Rival]] = {}
    last = best.free[-1] if shapes and not rig.layered else None
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
            without, gap = healthy(best, index, less, judged)
            if gap < needed(without, judged):
                best, changed = exact(rig, without, nothing), True
                break
            impossible = near(rig, best) and not best.possible(
                rig, index
            )  # by straight columns it was possible
            candidate = best.problem.candidates[index]
            # Its own shape may be another beside what was found since.
            others = proposals(
                rig, less, events=candidate.transient is None, known=candidate,
                shapes=_but(shapes, candidate) if index == last else None,
            )  # fmt: skip
            rivals[index] = [
                Rival(one.candidate, _gap(rig, best, index, less, judged, one))
                for one in others.offers
                if one.candidate.key != candidate.key
            ]
            rivals[index].append(Rival(None, gap))
            if impossible and others.best is None:
                best, changed = exact(rig, without, nothing), True
                break
            if others.best is not None and (
                impossible or others.best.score > judged.score + rules.EXCHANGED_NATS
            ):
                other = exact(rig, others.best, nothing)
                if impossible or _likelier(other, best):
                    best, changed = other, True
                    break
                # Not likelier where it is exact; and none of the others was likelier than that one.
                least = max(best.uncharged - other.uncharged, 0.0)
                rivals[index] = [
                    rival if rival.candidate is None else replace(rival, gap=max(rival.gap, least))
                    for rival in rivals[index]
                ]
            elif others.other is not None and others.other.score > judged.score - rules.EXCHANGED_NATS:
                # Equally likely by straight columns; exact ones may part them.
                other = exact(rig, others.other, nothing)
                if _likelier(other, best, rules.EXCHANGED_NATS):
                    best, changed = other, True
                    break
        if not changed:
            break
        last = None  # beside others by now
    for index in set(best.free) - set(rivals):  # exchanged in the last round
        rivals[index] = [Rival(None, best.score - best.without(index).score)]
    return best, rivals
