"""One law in place of several causes at a joint: each, however sure, may stand for a part of it."""

from __future__ import annotations

from collections.abc import Callable

from discrepancy.candidate import Candidate
from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.inference.refit import exact
from discrepancy.inference.search import Searched
from discrepancy.laws.bench import Bench
from discrepancy.laws.forms import likely_causes
from discrepancy.laws.search import Forms, Lawful, replaces, suffices, with_one, with_rivals
from discrepancy.laws.where import located


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
