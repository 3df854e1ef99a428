"""The likeliest hypothesis: causes are added, exchanged and taken away while that makes it likelier."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from discrepancy import rules
from discrepancy.candidate import Candidate
from discrepancy.inference.base import based, without_any
from discrepancy.inference.exchange import Rival, settled, without_healthy
from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.inference.offer.propose import Proposed, proposals
from discrepancy.inference.pays import gained, needed, tolerated
from discrepancy.inference.probability import probability
from discrepancy.inference.refit import exact
from discrepancy.inference.remainder import is_noise, nats_left, share_left, trace_nats, unlisted_nats
from discrepancy.inference.straightened import Beside, straightened
from discrepancy.least_squares.problem import Key
from discrepancy.rig import Rig

_LOG = logging.getLogger(__name__)


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
    return continued(_begun(*based(rig, odds, say), say), most, say, first)


def _begun(rig: Rig, nothing: Hypothesis, straight: bool, say: Callable[[str], object]) -> Searched:
    """Where a search begins: that nothing is there, linear around machines as they are found without any cause.

    Where machines of which little is known are found without a strong cause is where none of them are. Then it is
    linear around them as they are found beside the likeliest; which one that is may be another there.
    """
    say("scan")
    odds, missed = nothing.problem.odds, np.inf
    for _ in range(0 if straight else rules.BASE_ROUNDS):
        found = continued(Searched(rig, nothing, nothing, ()), 1, say, moves=False).best
        moved = rig.relinearised(found) if found.free else None
        if moved is None or moved.missed > rules.STRAIGHTER * missed:
            break
        say("linearise")
        rig, missed = moved, moved.missed
        del nothing, found, moved  # for the sake of memory
        nothing = without_any(rig, odds, say)
    return Searched(rig, nothing, nothing, ())


def continued(
    searched: Searched, most: int, say: Callable[[str], object],
    first: Callable[[Searched], Searched | None] | None = None,
    until: Callable[[Hypothesis], bool] | None = None,
    *, moves: bool = True,
) -> Searched:  # fmt: skip
    """Go on from what was found, until nothing pays.

    Args:
        searched: what was found.
        most, say, first: as of ``search``.
        until: asked of every step before it is refined: whether it is the last, and stays as it is; None for no.
        moves: whether all is linear where machines are found beside each cause; else it stays.
    """
    rig, nothing, best = searched.rig, searched.nothing, searched.best
    rivals: dict[int, list[Rival]] = dict(zip(best.free, map(list, searched.rivals), strict=True))
    del searched  # for the sake of memory
    doubtful, refused, but, all_exchanged = 0, 0, set[Key](), True
    while len(best.free) < most and doubtful < rules.DOUBTFUL and refused < rules.REFUSED:
        proposed = proposals(rig, best, nothing=nothing, but=but)
        _log_offers(best, proposed)
        added, shapes, reach = _added(best, proposed), proposed.shapes, proposed.within_reach(best)
        del proposed  # for the sake of memory
        if added is None:
            break
        if until is not None and until(added):
            best, all_exchanged = added, True
            break
        say(f"refit {added.causes[-1].label}")
        last, least = added.causes[-1], rules.LITTLE_SHARE * nats_left(best)
        little, alone = added.score - best.score < least, added.score - best.score < needed(best, added)
        added = exact(rig, added, nothing)
        if scattered := tolerated(best, added):
            if _form_of_a_fault(rig, best, last, scattered):
                _log_taken(f"{last.label}, the form of a fault of its kind, not taken", best, scattered)
                alike = {c.key for c in best.problem.candidates if c.cause == last.cause}
                refused, but = refused + 1, but | alike
                continue
            found, beside = without_healthy(rig, scattered, nothing), rivals
            pays = found.score - best.score >= rules.SHAPE_NATS
        else:
            if moves and added.score - best.score >= needed(best, added):
                told = [rivals.get(i, []) for i in best.free]
                rig, nothing, best, added = _where_found(rig, nothing, best, added, say)
                rivals = dict(zip(best.free, told, strict=True))
            found, beside = settled(rig, added, nothing, shapes, reach)
            pays = gained(best, found) >= needed(best, found)
        there = "there" if any(cause.key == last.key for cause in found.causes) else "another in its place"
        outcome = f"{last.label}, {'as far off as its kind scatters' if scattered else there}"
        _log_taken(outcome if pays else f"{outcome}, not taken", best, found)
        if not pays:  # where all is linear it did, which need not be so where it is exact
            if last.transient:  # its key is that of every other
                break
            refused, but = refused + 1, but | {last.key}
            continue
        refused, but, before = 0, set(), best.score
        best, rivals, all_exchanged = found, beside, not scattered
        if first is not None:
            instead = first(Searched(rig, nothing, best, tuple(tuple(rivals.get(i, [])) for i in best.free)))
            first = None
            if instead is not None:
                best, rivals = (
                    instead.best,
                    dict(zip(instead.best.free, map(list, instead.rivals), strict=True)),
                )
                continue
        if scattered:
            if alone:  # one after the other, such would account for any misfit
                doubtful = doubtful + 1 if best.score - before < least else 0
            continue
        newest = best.free[-1] if best.free else None
        likely = newest is None or _law_holds(rig, best, newest)
        doubtful = doubtful + 1 if little and not likely else 0
    if not all_exchanged:
        best, rivals = settled(rig, best, nothing)
    return Searched(rig, nothing, best, tuple(tuple(rivals.get(i, [])) for i in best.free))


def _where_found(
    rig: Rig, nothing: Hypothesis, base: Hypothesis, added: Hypothesis, say: Callable[[str], object]
) -> tuple[Rig, Hypothesis, Hypothesis, Hypothesis]:
    """All linear where machines are found beside the causes, step by step as long as that helps.

    Returns:
        The rig, that nothing is there, what was there before the last cause, and what is with it.
    """
    here, missed = Beside.of(rig, nothing, added), np.inf
    for _ in range(rules.BASE_ROUNDS):
        there = straightened(here, say)
        if there is None or there.rig.missed > rules.STRAIGHTER * missed:
            break
        here, missed = there, there.rig.missed
    before = base if here.found is added else here.found.without(here.found.free[-1])
    return here.rig, here.nothing, before, here.found


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


def _log_offers(base: Hypothesis, proposed: Proposed) -> None:
    """What one cause more would gain, the likeliest first, at level DEBUG: why something is named, or is not."""
    if not _LOG.isEnabledFor(logging.DEBUG):
        return
    there = ", ".join(cause.label for cause in base.causes) or "nothing"
    _LOG.debug("beside %s, %.1f nats:", there, base.score)
    for one in proposed.offers[: rules.LEADERS]:
        numbers = ", ".join(f"{name} {value:.4g}" for name, value in one.candidate.shape.items())
        _LOG.debug(
            "  %s%s: %+.1f", one.candidate.label, f" ({numbers})" if numbers else "", one.score - base.score
        )
    if proposed.best is not None:
        _LOG.debug("  needed: %.1f", needed(base, proposed.best))


def _log_taken(outcome: str, base: Hypothesis, now: Hypothesis) -> None:
    """What became of the likeliest, and what that gained where residuals are exact."""
    _LOG.debug("  %s: %+.1f", outcome, now.score - base.score)
