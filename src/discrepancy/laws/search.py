"""The search goes on where no listed cause is enough: laws are added while they help on trials left out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from discrepancy import rules
from discrepancy.engine.held_out import held_out_gains
from discrepancy.inference.exchange import Rival, settled
from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.inference.offer.propose import Offer, Proposed
from discrepancy.inference.probability import parted
from discrepancy.inference.refit import exact
from discrepancy.inference.remainder import unlisted_nats
from discrepancy.inference.scan import Scanned
from discrepancy.inference.search import Searched, continued
from discrepancy.inference.shape.sharpen import sharpened
from discrepancy.laws.bench import Bench
from discrepancy.laws.candidate import LawCandidate, candidate_of
from discrepancy.laws.forms import Forms, Refinement, gain_of, likely_causes
from discrepancy.laws.lines import line_nats
from discrepancy.laws.place import Place
from discrepancy.laws.what import Judged, judged
from discrepancy.laws.where import Located, located


@dataclass(frozen=True, eq=False)
class Lawful:
    """What became of a search that went on with laws.

    Attributes:
        searched: with the laws among its causes.
        places: where the first law was looked for, the likeliest first; empty where none was.
        refinements: laws that were found and are none of their own.
    """

    searched: Searched
    places: tuple[Located, ...]
    refinements: tuple[Refinement, ...] = ()


def with_laws(
    searched: Searched, most: int, progress: Callable[[str], object] | None = None, *, always: bool = False,
    instead: bool = False,
) -> Lawful:  # fmt: skip
    """Go on with a search until what is left is noise, or no law helps on trials that it was not fitted to.

    What is left may pass for noise where healthy robots leave as much, and yet lie at one place: then a law has to pay
    for all that noise may hide.

    Args:
        searched: what the catalogue can do.
        most: largest number of causes, laws among them.
        progress: called with what is being done.
        always: also where what is left is noise.
        instead: where what is left is noise, one law is tried in place of what was named, not beside it.
    """
    say = progress or (lambda what: None)
    bench: Bench | None = searched.rig.bench
    first: tuple[Located, ...] = ()
    rivals: dict[tuple[object, ...], list[Rival]] = {}
    refined: list[Refinement] = []
    for turn in range(rules.LAW_MOST if bench is not None else 0):
        assert bench is not None
        unlisted, places = unlisted_nats(searched.best), None
        left, least = always or unlisted >= rules.UNLISTED_NATS, rules.NAMED_NATS
        if not left and line_nats(searched.best.fit, bench) >= rules.UNLISTED_NATS:
            left, least = True, rules.UNLISTED_NATS
        if not left and unlisted >= rules.DOUBT_NATS:
            places = located_in(searched, bench, say)
            left = bool(places) and places[0].nats >= rules.UNLISTED_NATS
            least = rules.UNLISTED_NATS
        # Beside what leaves as little as noise; in place of it only where that is unsure.
        replacing = bool(searched.best.free) and not turn and (instead or places is None)
        if not (instead and replacing) and (not left or len(searched.best.free) >= most):
            break
        starts = [searched] if left else []
        if replacing:
            # Causes that were named may have stood for what nobody lists.
            starts.insert(0, Searched(searched.rig, searched.nothing, searched.nothing, ()))
        found, forms = [], Forms(bench, likely_causes(searched.best), refined)
        for start in starts:
            here = places if start is searched and places is not None else located_in(start, bench, say)
            first = first or tuple(here)
            step = with_one(start, bench, here, say, forms)
            # In place of what leaves noise it has to be likelier, and to do with as few (see ``replaces``).
            if step is not None and (left or _may_replace(step[0].best, searched.best, least)):
                # Beside noise it has to stand with all that it does not replace.
                besides = rules.LAW_CAUSES if left else len(searched.best.free)
                enough = min(most, len(step[0].best.free) + besides)
                # What would stand beside all that was named replaces nothing.
                until = None if left else lambda more: _holds_all(more, searched.best)  # noqa: B023
                now = _of_their_own(continued(step[0], enough, say, until=until), forms)
                found.append((now, step[1]))
                if suffices(now.best, searched.best):
                    break
        if not found:
            break
        best, more = max(found, key=lambda one: one[0].best.score)
        if best.best.score < searched.best.score + least:
            break
        if not left and not replaces(best.best, searched):
            break
        searched, rivals = best, rivals | more
    return Lawful(with_rivals(searched, rivals), first, tuple(refined))


def _of_their_own(searched: Searched, forms: Forms) -> Searched:
    """The search without laws that only refine those of the causes that were found beside them."""
    best = searched.best
    for index in best.free:
        if isinstance(best.problem.candidates[index], LawCandidate) and forms.refined_by(best, index):
            best = best.without(index)
    if best is searched.best:
        return searched
    best, rivals = settled(searched.rig, exact(searched.rig, best, searched.nothing), searched.nothing)
    return replace(searched, best=best, rivals=tuple(tuple(rivals.get(i, ())) for i in best.free))


def suffices(found: Hypothesis, named: Hypothesis) -> bool:
    """Whether a law, with what it goes with, is likelier than what was named and leaves noise, or holds all of that."""
    enough = unlisted_nats(found) < rules.UNLISTED_NATS or _holds_all(found, named)
    return enough and found.score >= named.score + rules.NAMED_NATS


def replaces(found: Hypothesis, searched: Searched) -> bool:
    """Whether a law takes the place of causes that leave noise: there are fewer, or it is likelier by far.

    No listed law is that of a real machine; what it is off by is no reason to take another (see ``parted``). Nor does
    what would pass for noise if nobody named it call for a law.
    """
    named, more = searched.best, len(found.free) - len(searched.best.free)
    if more > 0 or _holds_all(found, named):
        return False
    if found.score - searched.nothing.score < rules.UNLISTED_NATS:
        return False
    if more < 0:
        return True
    doubt = max((searched.rig.law_doubt(cause) for cause in named.causes), key=lambda one: one.towards_rivals)
    worth = named.score - searched.nothing.score
    return bool(parted([found.score - named.score], doubt, worth)[0] >= rules.NAMED_NATS)


def _may_replace(law: Hypothesis, named: Hypothesis, least: float) -> bool:
    return len(law.free) < len(named.free) or law.score >= named.score + least


def _holds_all(found: Hypothesis, named: Hypothesis) -> bool:
    return {cause.key for cause in named.causes} <= {cause.key for cause in found.causes}


def located_in(searched: Searched, bench: Bench, say: Callable[[str], object]) -> list[Located]:
    """Every place with the error that it would have to have, the likeliest first."""
    say("locate what nobody lists")
    return located(searched.best.fit, bench, bench.places)


def with_one(
    searched: Searched, bench: Bench, places: Sequence[Located], say: Callable[[str], object],
    forms: Forms, least: float = -np.inf,
) -> tuple[Searched, dict[tuple[object, ...], list[Rival]]] | None:  # fmt: skip
    """The search with one law more, and that law's rivals among laws; None where no law of its own pays and helps.

    Args:
        searched: what is there.
        bench: of the rig.
        places: where to look.
        say: called with what is being done.
        forms: of what is named.
        least: nats that the likeliest formula must have at first sight to be looked at closely.
    """
    proposed = _proposals(searched, bench, places, say, least)
    added = proposed.best
    if added is None or added.score - searched.best.score < rules.NAMED_NATS:
        return None
    if forms.among(proposed):
        return None
    say(f"refit {added.causes[-1].label}")
    refitted = exact(searched.rig, added, searched.nothing)
    if not helps(refitted, refitted.free[-1]):
        return None
    if forms.refined_by(refitted, refitted.free[-1]):
        return None
    law = refitted.causes[-1]
    now, rivals = settled(searched.rig, refitted, searched.nothing)
    each = tuple(tuple(rivals.get(i, ())) for i in now.free)
    return Searched(searched.rig, searched.nothing, now, each), {law.key: _rivals(bench, proposed)}


def helps(hypothesis: Hypothesis, index: int) -> bool:
    """Whether a law helps where it was not fitted: most trials, and by much of what it explains in sample."""
    others = [i for i in hypothesis.free if i != index]
    folds = held_out_gains(hypothesis.problem, others, index)
    if not folds:
        return False
    in_sample = gain_of(hypothesis, index)
    better = np.mean(np.array(folds) > 0.0)
    return bool(sum(folds) > rules.LAW_HELD_OUT * in_sample and better > rules.LAW_FOLDS)


def _proposals(
    searched: Searched, bench: Bench, places: Sequence[Located], say: Callable[[str], object], least: float
) -> Proposed:
    """Hypotheses with one law more, each with the best numbers inside."""
    base = searched.best
    say("try formulas")
    ranked = judged(base.fit, bench, _tried(places))
    best, offers = None, []
    leaders = _leaders(ranked, base) if ranked and ranked[0].nats >= least else []
    for item in leaders:
        candidate = _candidate(item, bench)
        scanned = Scanned(None, candidate, item.nats, tuple(searched.rig.columns(candidate)))
        new = sharpened(searched.rig, base, scanned, near=item.nats > rules.LAW_NEAR * leaders[0].nats)
        offers.append(Offer(new.causes[-1], new.score, new.score))
        if best is None or new.score > best.score:
            best = new
    return Proposed(best, tuple(sorted(offers, key=lambda one: -one.score)))


def _tried(places: Sequence[Located]) -> list[Place]:
    """The likeliest places, and all of several components: their curves are too slow to show all that laws do there."""
    likeliest = [one.place for one in places[: rules.LAW_PLACES]]
    vectors = [one.place for one in places if len(one.place.axes) > 1 and one.place not in likeliest]
    return [*likeliest, *vectors]


def _leaders(ranked: Sequence[Judged], base: Hypothesis) -> list[Judged]:
    """The likeliest formulas, one of each kind, that are not in the model yet."""
    there = {cause.key for cause in base.causes}
    chosen: dict[tuple[object, ...], Judged] = {}
    for item in ranked:
        kind = item.place.key, item.term.function, item.term.variables
        # A sine has as many forms as it has periods a turn.
        kinds = (*kind, 0), (*kind, 1)
        if candidate_of(item.place, item.term, 1.0, 1).key in there:
            continue
        for kind_ in kinds[: 2 if item.term.function in ("sine", "hum") else 1]:
            if kind_ not in chosen:
                chosen[kind_] = item
                break
        if len(chosen) == rules.LAW_LEADERS:
            break
    return list(chosen.values())


def _candidate(item: Judged, bench: Bench) -> LawCandidate:
    """With its prior: what depends on the place's own signals, or on time, is likelier beforehand."""
    own = {variable.name for variable in item.place.own} | {"time"}
    others = 1 if own.issuperset(item.term.variables) else len(bench.variables)
    unit = item.place.unit
    inside = 1 if item.term.function == "spline" else rules.LAW_INSIDE ** len(item.term.numbers)
    among = len(bench.places) * rules.LAW_FORMS * others * inside
    return candidate_of(item.place, item.term, rules.LAW_SCALES[unit], among)


def _rivals(bench: Bench, proposed: Proposed) -> list[Rival]:
    """What else could be there instead of the first, and the place that the rows cannot tell from it."""
    first, *others = proposed.offers
    law = first.candidate
    out: dict[tuple[object, ...], Rival] = {}
    assert isinstance(law, LawCandidate)
    twin = bench.twin(law.at)
    if twin is not None:
        other = replace(law, at=twin, title=twin.title)
        out[other.key] = Rival(other, 0.0)
    for one in others:
        if one.candidate.key != law.key and one.candidate.key not in out:
            out[one.candidate.key] = Rival(one.candidate, first.score - one.score)
    return list(out.values())[: rules.LAW_RIVALS]


def with_rivals(searched: Searched, laws: dict[tuple[object, ...], list[Rival]]) -> Searched:
    """The search with every law's rivals among laws, besides those of the catalogue."""
    out = []
    for cause, rivals in zip(searched.best.causes, searched.rivals, strict=True):
        more = [r for r in laws.get(cause.key, []) if r.candidate is not None]
        out.append(tuple(sorted((*rivals, *more), key=lambda rival: rival.gap)))
    return replace(searched, rivals=tuple(out))
