"""Which causes could be added to a hypothesis: each at its best shape, the likeliest first."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain

import numpy as np

from discrepancy import rules
from discrepancy.candidate import Candidate
from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.inference.offer.imitation import imitated
from discrepancy.inference.offer.narrow import with_kinds_narrow
from discrepancy.inference.other_forms import beside_other_forms
from discrepancy.inference.scan import Scanned, events_of, in_best_shape, scan, score_of
from discrepancy.inference.shape.sharpen import sharpened
from discrepancy.inference.twins import twins
from discrepancy.least_squares.fit import Fit
from discrepancy.least_squares.problem import Key
from discrepancy.rig import Rig


@dataclass(frozen=True, eq=False)
class Offer:
    """A cause that could be added, in its shape.

    Attributes:
        candidate: the cause.
        score: how likely the hypothesis with it is [nats].
        alike: the same, charged only for what the known one is charged for, too.
    """

    candidate: Candidate
    score: float
    alike: float


@dataclass(frozen=True, eq=False)
class Proposed:
    """Hypotheses with one cause more.

    Attributes:
        best: the likeliest; the added cause is the last of its ``free``. None where none is possible.
        offers: what is added, the likeliest first.
        other: the likeliest whose added cause is not the one that is known; None without one.
        open: the one that would be likeliest if its added cause were as far off as its kind scatters, of those that
            leave something open; None without one, or where a cause is known.
        shapes: lasting causes whose shapes were sought to the end, in these.
    """

    best: Hypothesis | None
    offers: tuple[Offer, ...]
    other: Hypothesis | None = None
    open: Hypothesis | None = None
    shapes: Mapping[Key, Candidate] = field(default_factory=dict)

    def within_reach(self, base: Hypothesis) -> set[Key]:
        """Lasting causes that may be in the place of the likeliest: those worth enough beside what was there before."""
        most = self.offers[0].score if self.offers else base.score
        least = min(most - rules.REACH_NATS, base.score + rules.REACH_SHARE * (most - base.score))
        return {
            one.candidate.key for one in self.offers if one.score >= least and not one.candidate.transient
        }


def proposals(
    rig: Rig, base: Hypothesis, *, events: bool = True, nothing: Hypothesis | None = None,
    known: Candidate | None = None, shapes: Mapping[Key, Candidate] | None = None, but: Collection[Key] = (),
    among: Collection[Key] | None = None,
) -> Proposed:  # fmt: skip
    """Hypotheses with one cause more.

    Args:
        rig: for columns of other shapes.
        base: what is there already.
        events: whether to look for what acts for a while, too.
        nothing: the hypothesis that nothing is there, to look with kinds that scatter held within their tolerance, too;
            None not to.
        known: a cause that others are to be held against.
        shapes: of what was sought beside the same causes before, where a search begins and ends; None for nothing.
        but: lasting causes that are none of them.
        among: the only lasting causes that are; None for any.
    """
    fit, shapes = base.fit, shapes or {}
    left_out = {c.key for c in base.problem.candidates if among is not None and c.key not in among} | {*but}
    scanned = [item for item in _with_kinds_held(base) if item.candidate.key not in left_out]
    loud = {item.candidate.joint for item in scanned if item.score > rules.LOOKED_AT_NATS}
    ranked = [in_best_shape(rig, fit, item, loud) for item in scanned]
    ranked += events_of(rig, fit) if events else []
    ranked.sort(key=lambda item: -item.score)
    most = _Most(rig, base, known)  # each has its own columns: all together would be gigabytes
    offered = chain(
        _hypotheses(rig, base, ranked, shapes, nothing, left_out),
        _sharper(rig, base, ranked, shapes, most.rough, most.offers),
    )
    for item, new in offered:
        most.hold(item, new)
        del new  # for the sake of memory
    offers = sorted(most.offers.values(), key=lambda one: -one.score)
    return Proposed(most.best, tuple(offers), most.other, most.open, most.sought)


@dataclass(eq=False)
class _Most:
    """The likeliest of the hypotheses so far, as in ``Proposed``, and of all what is offered.

    Attributes:
        rig, base, known: as of ``proposals``.
        most: score of the likeliest that leaves something open, tolerated.
        offers: by what is added.
        rough: what was not sharpened, and the score of the hypothesis with it.
    """

    rig: Rig
    base: Hypothesis
    known: Candidate | None
    best: Hypothesis | None = None
    other: Hypothesis | None = None
    open: Hypothesis | None = None
    most: float = -np.inf
    offers: dict[tuple[object, ...], Offer] = field(default_factory=dict)
    rough: list[tuple[Scanned, float]] = field(default_factory=list)
    sought: dict[Key, Candidate] = field(default_factory=dict)

    def hold(self, item: Scanned | None, bare: Hypothesis) -> None:
        """Hold one more against the others; with its item where its shape has not been sharpened."""
        rig, base, known = self.rig, self.base, self.known
        new = beside_other_forms(rig, bare, bare.free[-1], base)
        last = new.causes[-1]
        which = (last.key, last.transient)
        if which in self.offers and self.offers[which].score >= new.score:
            return
        if not new.possible(rig, new.free[-1]) or imitated(rig, base, new):
            return
        alike = new.score
        if known is not None and not rig.charged_alike(last, known):
            alike = beside_other_forms(rig, bare, bare.free[-1], base, known).score
        self.offers[which] = Offer(last, new.score, alike)
        if item is not None:
            self.rough.append((item, new.score))
        elif last.transient is None:
            self.sought[last.key] = last
        if self.best is None or new.score > self.best.score:
            self.best = new
        if known is None:
            self._hold_open(new)
        elif last.key != known.key and (self.other is None or new.score > self.other.score):
            self.other = new

    def _hold_open(self, new: Hypothesis) -> None:
        key = new.causes[-1].key
        if key in new.problem.opened and key not in self.base.problem.opened:
            tolerated = new.tolerating(new.free[-1])
            if tolerated is not None and tolerated.score > self.most:
                self.open, self.most = new, tolerated.score


def _hypotheses(
    rig: Rig,
    base: Hypothesis,
    ranked: Sequence[Scanned],
    shapes: Mapping[Key, Candidate],
    nothing: Hypothesis | None,
    but: Collection[Key],
) -> Iterator[tuple[Scanned | None, Hypothesis]]:
    """One after the other, each with one cause more, and its item where its shape has not been sharpened."""
    for item in _chosen(ranked, rules.LEADERS, base.problem.opened):
        near = item.loud or item.score > ranked[0].score - rules.CLOSE_NATS
        yield (
            None if near else item,
            sharpened(rig, base, item, near=near, shape=shapes.get(item.candidate.key)),
        )
    if nothing is not None:
        narrow = with_kinds_narrow(rig, base, nothing)
        yield from ((None, new) for new in narrow if new.causes[-1].key not in but)


def _sharper(
    rig: Rig,
    base: Hypothesis,
    ranked: Sequence[Scanned],
    shapes: Mapping[Key, Candidate],
    rough: Sequence[tuple[Scanned, float]],
    offers: Mapping[tuple[object, ...], Offer],
) -> Iterator[tuple[None, Hypothesis]]:
    """After all, what is rough and the likeliest, or might be if its shape were not.

    Kinds that scatter are scanned as if they did not: where robots are off everywhere nothing else is near. What is at
    the likeliest's place leaves much the same trace there, in a shape that the scan may not have: friction of a joint
    beside that of its spring, a base beside its grasp.

    Args:
        rig: for columns of other shapes.
        base: what is there already.
        ranked: the scan.
        shapes: as of ``proposals``.
        rough: what was not sharpened, with scores.
        offers: all, to be asked when they are known.
    """
    first = max(offers.values(), key=lambda one: one.score, default=None)
    most = first.score if first else base.score
    # One whose shapes are far apart, once it has the best, is no measure for others that have not: their scans are.
    its_own = (item.score for item in ranked if first and item.candidate.key == first.candidate.key)
    seen = max(its_own, default=np.inf)
    first_coarse = first is not None and first.candidate.cause in rig.coarse
    for item, score in list(rough):
        coarse = item.candidate.cause in rig.coarse
        reach = (1.0 - rules.COARSE_SHARE) * max(most - base.score, 0.0) if coarse else 0.0
        near = score >= most - reach
        if coarse and first_coarse:
            near = near or item.score >= min(rules.COARSE_SHARE * seen, seen)
        elif first and _at_one_place(item.candidate, first.candidate):
            near = near or item.score >= max(rules.PLACE_SHARE * seen, 0.0)
        shapes_of = (rig.refinements, rig.steps, rig.further)
        if near and any(of(item.candidate) for of in shapes_of):
            yield None, sharpened(rig, base, item, near=True, shape=shapes.get(item.candidate.key))


def _at_one_place(one: Candidate, other: Candidate) -> bool:
    """Whether two lasting causes are at the same robot and joint, of which one may be of the robot as a whole."""
    if one.transient or other.transient or one.robot != other.robot:
        return False
    return one.joint == other.joint or (one.robot is not None and None in (one.joint, other.joint))


def _with_kinds_held(base: Hypothesis) -> list[Scanned]:
    """The scan; kinds that scatter also within their tolerance: one fault among healthy ones looks like a scatter."""
    problem, found = base.problem, {item.index: item for item in scan(base.fit)}
    kinds: dict[str, list[int]] = {}
    for index, candidate in enumerate(problem.candidates):
        if index not in base.free and problem.has_tolerance(index) and not candidate.hidden:
            kinds.setdefault(candidate.cause, []).append(index)
    wide = {
        kind
        for kind, members in kinds.items()
        if problem.spread[problem.columns_of(members[0])][0] > rules.HELD_FACTOR
    }
    same = twins(problem, kinds) if wide else []
    for kind, members in kinds.items():
        held = wide & {kind, *(k for pair in same if kind in pair for k in pair)}
        if held:
            spread = problem.spread.copy()
            # What leaves the same trace would take the fault for a scatter of its own.
            for index in (i for one in held for i in kinds[one]):
                spread[problem.columns_of(index)] = 1.0
            fit = Fit.of(replace(problem, spread=spread), base.free)
            for index in (i for i in members if i in found):
                score = score_of(fit, index)
                if score > found[index].score:
                    found[index] = Scanned(index, problem.candidates[index], score, held=True)
    return list(found.values())


def _chosen(ranked: Sequence[Scanned], leaders: int, opened: Collection[Key]) -> list[Scanned]:
    """The likeliest of all, and of every other cause that may be there its likeliest place.

    Of a cause that leaves something open also the likeliest where it does not yet. There is room for so many of those
    whose kind is held within its tolerance: where all is off they go before any other. What lasts and is likely as all
    scatters is among them in any case, and of events what stands out of noise as it should be: with room for others a
    healthy team had pushes.
    """

    def kind(item: Scanned) -> tuple[str, bool]:
        return item.candidate.cause, item.candidate.key in opened

    likely = [item for item in ranked if item.loud or item.score > rules.LOOKED_AT_NATS]
    chosen, kinds = likely[:leaders], {kind(item) for item in likely[:leaders]}
    for item in likely[leaders:]:
        if kind(item) not in kinds or item.loud:
            kinds.add(kind(item))
            chosen.append(item)
    roomless = [
        item for item in chosen[2 * leaders :] if item.loud or not (item.held or item.candidate.transient)
    ]
    return chosen[: 2 * leaders] + roomless
