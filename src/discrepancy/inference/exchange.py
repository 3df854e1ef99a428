"""Causes that are there are exchanged and taken away while that makes a hypothesis likelier."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

from discrepancy import rules
from discrepancy.candidate import Candidate
from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.inference.offer.propose import Offer, proposals
from discrepancy.inference.other_forms import beside_other_forms
from discrepancy.inference.pays import healthy, needed
from discrepancy.inference.refit import exact, near
from discrepancy.inference.shape.reshape import reshaped, settled_shape
from discrepancy.least_squares.problem import Key
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


def without_healthy(rig: Rig, best: Hypothesis, nothing: Hypothesis) -> Hypothesis:
    """Take away causes until none is likelier to be as far off only as its kind scatters, or not there."""
    for _ in range(rules.EXCHANGES):
        for index in best.free:
            less = best.without(index)
            judged = beside_other_forms(rig, best, index, less)
            without, gap = healthy(best, index, less, judged)
            if gap < needed(without, judged):
                best = exact(rig, without, nothing)
                break
        else:
            break
    return best


def settled(
    rig: Rig, best: Hypothesis, nothing: Hypothesis, shapes: Mapping[Key, Candidate] | None = None,
    reach: Collection[Key] | None = None,
) -> tuple[Hypothesis, dict[int, list[Rival]]]:  # fmt: skip
    """Exchange and take away causes until none is likelier, and what could be there instead of each.

    Args:
        rig: for columns.
        best: what is there.
        nothing: the hypothesis that nothing is.
        shapes: what was sought in place of the last of the causes, in these shapes; None where it was not.
        reach: lasting causes that may be there instead of that; None for any.
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
            among, known = (reach, shapes) if index == last else (None, None)
            other, told = _exchanged(rig, best, nothing, index, among, known)
            rivals |= {index: told} if told else {}
            if other is not None:
                best, changed = other, True
                break
        if not changed:
            break
        last = None  # beside others by now
    for index in set(best.free) - set(rivals):  # exchanged in the last round
        rivals[index] = [Rival(None, best.score - best.without(index).score)]
    return best, rivals


def _exchanged(
    rig: Rig, best: Hypothesis, nothing: Hypothesis, index: int, among: Collection[Key] | None,
    shapes: Mapping[Key, Candidate] | None,
) -> tuple[Hypothesis | None, list[Rival]]:  # fmt: skip
    """What is likelier with another in place of one of the causes, or nothing, if any; and what else could be there.

    Of what goes for nothing no others are sought.

    Args:
        rig, best, nothing: as of ``settled``.
        index: which of the causes.
        among, shapes: as of ``proposals``.
    """
    less = best.without(index)
    # Its own loss to forms of the others is judged here, but counted once: not theirs to its forms, too.
    judged = beside_other_forms(rig, best, index, less)
    without, gap = healthy(best, index, less, judged)
    if gap < needed(without, judged):
        return exact(rig, without, nothing), []
    # By straight columns it was possible.
    impossible = near(rig, best) and not best.possible(rig, index)
    candidate = best.problem.candidates[index]
    # Its own shape may be another beside what was found since.
    others = proposals(
        rig,
        less,
        events=candidate.transient is None,
        known=candidate,
        shapes=_but(shapes, candidate),
        among=among,
    )
    rivals = [
        Rival(one.candidate, _gap(rig, best, index, less, judged, one))
        for one in others.offers
        if one.candidate.key != candidate.key
    ]
    rivals.append(Rival(None, gap))
    if impossible and others.best is None:
        return exact(rig, without, nothing), rivals
    if others.best is not None and (impossible or others.best.score > judged.score + rules.EXCHANGED_NATS):
        other = exact(rig, others.best, nothing)
        if impossible or _likelier(other, best):
            return other, rivals
        # Not likelier where it is exact; and none of the others was likelier than that one.
        least = max(best.uncharged - other.uncharged, 0.0)
        rivals = [r if r.candidate is None else replace(r, gap=max(r.gap, least)) for r in rivals]
    elif others.other is not None and others.other.score > judged.score - rules.EXCHANGED_NATS:
        # Equally likely by straight columns; exact ones may part them.
        other = exact(rig, others.other, nothing)
        if _likelier(other, best, rules.EXCHANGED_NATS):
            return other, rivals
    return None, rivals


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
