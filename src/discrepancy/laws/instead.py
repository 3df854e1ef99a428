"""A law in place of causes: of the first that is found, if it leaves more than noise; or of what leaves noise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from discrepancy import rules
from discrepancy.candidate import Candidate
from discrepancy.inference.exchange import Rival
from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.inference.refit import exact
from discrepancy.inference.scan import score_of
from discrepancy.inference.search import Searched
from discrepancy.laws.bench import Bench
from discrepancy.laws.candidate import LawCandidate
from discrepancy.laws.forms import Forms, likely_causes
from discrepancy.laws.lines import nats_beyond_noise
from discrepancy.laws.place import Place
from discrepancy.laws.search import Lawful, located_in, replaces, suffices, with_one, with_rivals
from discrepancy.laws.where import Located, located
from discrepancy.least_squares.problem import Key


@dataclass(eq=False)
class LawFirst:
    """Asked once in a search, after its first step: a cause, or one that healthy ones have, too.

    Attributes:
        progress: called with what is being done.
        cause: the search with that step, where a law took its place; otherwise None.
        places: where the law was looked for, the likeliest first; empty where none was.
        rivals: of the law, among laws.
    """

    progress: Callable[[str], object] | None = None
    cause: Searched | None = None
    places: tuple[Located, ...] = ()
    rivals: dict[tuple[object, ...], list[Rival]] = field(default_factory=dict)

    def __call__(self, searched: Searched) -> Searched | None:
        """The search with a law in place of its only step, if that law alone leaves noise, and the step does not.

        Where several things are there, each of them leaves more: then the search goes on as it would.
        """
        bench: Bench | None = searched.rig.bench
        if bench is None or nats_beyond_noise(searched.best, bench) < rules.UNLISTED_NATS:
            return None
        say = self.progress or (lambda what: None)
        start = Searched(searched.rig, searched.nothing, searched.nothing, ())
        places = located_in(start, bench, say)
        step = with_one(start, bench, places, say, Forms(bench, likely_causes(searched.best), []))
        if step is None or nats_beyond_noise(step[0].best, bench) >= rules.UNLISTED_NATS:
            return None
        if step[0].best.score < searched.best.score + rules.UNLISTED_NATS:
            return None
        self.cause, self.places, self.rivals = searched, tuple(places), step[1]
        return step[0]

    def known_to(self, searched: Searched) -> Searched:
        """The search with the law's rivals."""
        return with_rivals(searched, self.rivals)


def in_place(searched: Searched, progress: Callable[[str], object] | None = None) -> Lawful | None:
    """One law in place of what was named at one site; None where there is none.

    Causes that leave noise may be wrong all the same: several at a joint as if each stood for a part of a law, and one
    because it is the nearest that the catalogue has. In its place the law has to be likelier by ``LAW_LEAD_NATS``.

    Args:
        searched: what the catalogue can do; it leaves noise.
        progress: called with what is being done.
    """
    bench: Bench | None = searched.rig.bench
    found: Lawful | None = None
    for site in sites(searched) if bench is not None else ():
        assert bench is not None
        cause = next((cause for cause in searched.best.causes if cause.key in site), None)
        if cause is None:  # gone with another, for a law that is there by now
            continue
        less = searched.best
        for index in less.free:
            if less.problem.candidates[index].key in site:
                less = less.without(index)
        start = Searched(searched.rig, searched.nothing, exact(searched.rig, less, searched.nothing), ())
        places = located(start.best.fit, bench, [place for place in bench.places if _at(cause, place)])
        forms = Forms(bench, likely_causes(searched.best), [])
        say, lead, least = progress or (lambda what: None), rules.NAMED_NATS, -np.inf
        if len(site) == 1:
            # What is listed in its place explains at first sight, too, if it is what is there.
            lead = rules.LAW_LEAD_NATS
            least = max([lead, *(score_of(start.best.fit, index) for index in _of(start.best, cause))])
        step = with_one(start, bench, places, say, forms, least)
        if step is None or step[0].best.score < searched.best.score + lead:
            continue
        if suffices(step[0].best, searched.best) and replaces(step[0].best, searched):
            searched = with_rivals(*step)
            found = Lawful(searched, tuple(places))
    return found


def sites(searched: Searched) -> list[set[Key]]:
    """Causes of which one law may take the place: all at a joint; or one alone, where no doubt about its law says more.

    Of any robot listed laws are off by more than what parts them from others.
    """
    joints: dict[tuple[int | None, int], list[Candidate]] = {}
    for cause in searched.best.causes:
        if cause.joint is not None:
            joints.setdefault((cause.robot, cause.joint), []).append(cause)
    each = [*joints.values(), *([cause] for cause in searched.best.causes if cause.joint is None)]
    return [{c.key for c in causes} for causes in each if len(causes) > 1 or _alone(searched, causes[0])]


def _alone(searched: Searched, cause: Candidate) -> bool:
    lasting = cause.transient is None and not isinstance(cause, LawCandidate)
    return lasting and not searched.rig.law_doubt(cause).towards_rivals


def _of(hypothesis: Hypothesis, cause: Candidate) -> list[int]:
    """Which candidates of a hypothesis a cause is."""
    return [index for index, other in enumerate(hypothesis.problem.candidates) if other.key == cause.key]


def _at(cause: Candidate, place: Place) -> bool:
    """Whether a law at a place could be taken for a cause: at its joint, or at its robot or the payload."""
    if cause.joint is not None:
        return (place.robot, place.joint) == (cause.robot, cause.joint)
    return place.robot in (None, cause.robot)
