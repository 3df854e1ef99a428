"""A law in place of causes: of the first that is found, if it leaves more than noise; or of several at a joint."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from discrepancy import rules
from discrepancy.candidate import Candidate
from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.inference.refit import exact
from discrepancy.inference.search import Rival, Searched
from discrepancy.laws.bench import Bench
from discrepancy.laws.forms import likely_causes
from discrepancy.laws.lines import nats_beyond_noise
from discrepancy.laws.search import Forms, Lawful, located_in, replaces, suffices, with_one, with_rivals
from discrepancy.laws.where import Located, located


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


def in_place_of_several(searched: Searched, progress: Callable[[str], object] | None = None) -> Lawful | None:
    """One law in place of several causes at one joint, as if each stood for a part of it; None where there is none.

    Args:
        searched: what the catalogue can do; it leaves noise.
        progress: called with what is being done.
    """
    bench: Bench | None = searched.rig.bench
    found: Lawful | None = None
    for joint in crowded(searched.best) if bench is not None else ():
        assert bench is not None
        less = searched.best
        for index in less.free:
            if _joint(less.problem.candidates[index]) == joint:
                less = less.without(index)
        start = Searched(searched.rig, searched.nothing, exact(searched.rig, less, searched.nothing), ())
        here = [place for place in bench.places if (place.robot, place.joint) == joint]
        places = located(start.best.fit, bench, here)
        forms = Forms(bench, likely_causes(searched.best), [])
        step = with_one(start, bench, places, progress or (lambda what: None), forms)
        if step is not None and suffices(step[0].best, searched.best) and replaces(step[0].best, searched):
            searched = with_rivals(*step)
            found = Lawful(searched, tuple(places))
    return found


def crowded(hypothesis: Hypothesis) -> list[tuple[int | None, int | None]]:
    """Joints with several causes."""
    joints = [_joint(cause) for cause in hypothesis.causes if cause.joint is not None]
    return [joint for joint in dict.fromkeys(joints) if joints.count(joint) > 1]


def _joint(cause: Candidate) -> tuple[int | None, int | None]:
    return cause.robot, cause.joint
