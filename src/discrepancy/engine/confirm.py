"""The causes in the closed loop: recorded commands simulated again, a test that the rows know nothing of."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from discrepancy import rules
from discrepancy.candidate import Candidate
from discrepancy.digits import three_digits
from discrepancy.engine.explanation import Explanation, Found, explain
from discrepancy.engine.gain import responses
from discrepancy.inference.exchange import Rival
from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.inference.probability import probability
from discrepancy.inference.refit import exact
from discrepancy.inference.search import Searched
from discrepancy.least_squares.problem import Problem
from discrepancy.rig import Rig
from discrepancy.team.gain import Gain, is_worse, mean_chi2


@dataclass(frozen=True)
class Alternative:
    """A rival of a named cause.

    Attributes:
        candidate: the rival.
        evidence_gap: by which the rows prefer the named cause [nats].
        chi2_per_n: of the closed loop with the rival in place of the cause, or None if not simulated.
        ambiguous: whether neither rows nor closed loop can tell it from the cause.
    """

    candidate: Candidate
    evidence_gap: float
    chi2_per_n: float | None
    ambiguous: bool


@dataclass(frozen=True, eq=False)
class Confirmed:
    """What the closed loop made of an explanation.

    Attributes:
        explanation: with what responds best, where the rows could not tell.
        alternatives: per cause, its rivals.
        gain: responses without and with the causes.
        contradicted: whether the causes make the response worse.
        notes: sentences about what was exchanged or is contradicted.
    """

    explanation: Explanation
    alternatives: tuple[tuple[Alternative, ...], ...]
    gain: Gain
    contradicted: bool
    notes: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class _Swap:
    """A rival in the place of a named cause.

    Attributes:
        cause: the named one.
        rival, index: the other, and which candidate of the problem it is.
        gap: by which the rows prefer the cause [nats].
        free: indices of all causes of this hypothesis.
    """

    cause: Found
    rival: Candidate
    index: int
    gap: float
    free: tuple[int, ...]


def confirm(
    rig: Rig, explanation: Explanation, jobs: int = 1, simulated: Callable[[int], object] | None = None
) -> Confirmed:
    """Simulate without causes, with them, and with each rival in a cause's place that the rows cannot tell from it.

    Args:
        rig: that can simulate.
        explanation: with at least one cause.
        jobs: parallel processes.
        simulated: called with 1 for every simulated trial.
    """
    problem, swaps = _swaps(rig, explanation)
    free = explanation.fit.free
    hypotheses = [(), free, *(swap.free for swap in swaps)]
    before, after, *others = responses(rig, problem, hypotheses, jobs, simulated)
    notes: list[str] = []
    best, winner = mean_chi2(after), None
    tried = {(found.index, found.candidate.key): best for found in explanation.found}
    for swap, response in zip(swaps, others, strict=True):
        value = mean_chi2(response)
        tried[swap.cause.index, swap.rival.key] = value
        if value < best * (1.0 - rules.MARGIN_SHARE):
            notes.append(
                f"The rows alone could not tell {swap.cause.candidate.label} from {swap.rival.label}; in closed loop "
                f"the latter does better (chi2/n {three_digits(value)} against {three_digits(best)})."
            )
            best, winner, after = value, swap, response
    if winner is not None:
        explanation = _exchanged(rig, explanation, problem, winner)
    none = mean_chi2(before)
    contradicted = is_worse(best, none)
    if contradicted:
        loop = (
            f"makes the response to the commands worse (chi2/n {three_digits(none)} to {three_digits(best)})"
            if np.isfinite(best)
            else "cannot be simulated with the recorded commands"
        )
        notes.append(f"{labels(explanation.found)}: {loop}, which speaks against it.")
    place = {winner.index: winner.cause.index} if winner else {}
    alternatives = tuple(
        tuple(
            _alternative(item, c, gap, tried.get((place.get(item.index, item.index), c.key)), best)
            for c, gap in item.rivals
        )
        for item in explanation.found
    )
    weight = rules.CONTRADICTED if contradicted else 1.0
    found = tuple(
        replace(
            item,
            probability=weight * _decided(item, others),
            probability_alike=weight * item.probability_alike,
        )
        for item, others in zip(explanation.found, alternatives, strict=True)
    )
    explanation = replace(explanation, found=found)
    held_out = len(rig.trials) > 1 and not any(item.candidate.of_trials for item in found)
    gain = Gain(before, after, held_out)
    return Confirmed(explanation, alternatives, gain, contradicted, tuple(notes))


def _decided(found: Found, alternatives: Sequence[Alternative]) -> float:
    """The probability of a cause once the closed loop has spoken: a rival that does worse there is no look-alike."""
    gaps = [*map(decided_gap, alternatives)]
    return found.weight * probability(gaps, found.share_left, found.doubt, found.over_nothing)


def decided_gap(other: Alternative) -> float:
    """By how much a rival is less likely once the closed loop has spoken [nats]."""
    open_ = other.ambiguous or other.chi2_per_n is None
    return other.evidence_gap if open_ else max(other.evidence_gap, rules.AMBIGUOUS_NATS)


def _exchanged(rig: Rig, explanation: Explanation, problem: Problem, winner: _Swap) -> Explanation:
    """The explanation with the rival in the cause's place."""
    best = exact(
        rig, Hypothesis.of(problem, winner.free, explanation.hypothesis.allowed), explanation.nothing
    )
    rivals = []
    for index in winner.free:
        (old,) = [
            f
            for f in explanation.found
            if f.index == (winner.cause.index if index == winner.index else index)
        ]
        own = [Rival(c, gap) for c, gap in old.rivals]
        if index == winner.index:
            # The closed loop has decided between these two.
            own = [Rival(winner.cause.candidate, rules.AMBIGUOUS_NATS)]
            own += [Rival(c, gap) for c, gap in old.rivals if c.key != winner.rival.key]
        rivals.append((*own, Rival(None, old.over_nothing)))
    return explain(Searched(rig, explanation.nothing, best, tuple(rivals)))


def _alternative(
    found: Found, rival: Candidate, gap: float, chi2_per_n: float | None, best: float
) -> Alternative:
    apart = chi2_per_n is not None and chi2_per_n > best * (1.0 + rules.MARGIN_SHARE)
    return Alternative(rival, gap, chi2_per_n, gap < found.told_nats and not apart)


def not_simulated(found: Found) -> tuple[Alternative, ...]:
    """A cause's rivals by the rows alone."""
    return tuple(_alternative(found, rival, gap, None, np.inf) for rival, gap in found.rivals)


def _swaps(rig: Rig, explanation: Explanation) -> tuple[Problem, list[_Swap]]:
    """Rivals that the rows put close to a cause, each in its place, and the problem with their best columns."""
    problem, free, swaps = explanation.problem, explanation.fit.free, []
    for found in explanation.found:
        for rival, gap in found.rivals:
            index = problem.index_of(rival)
            if index in free or gap > rules.AMBIGUOUS_NATS or rival.transient:
                continue
            if index is None:  # a law: those are not listed beforehand
                index = len(problem.candidates)
                problem = problem.extended(rival, rig.columns(rival))
            else:
                problem = problem.with_columns(index, rival, rig.columns(rival))
            swapped = tuple(index if i == found.index else i for i in free)
            swaps.append(_Swap(found, rival, index, gap, swapped))
    return problem, swaps


def labels(found: Iterable[Found]) -> str:
    """Causes and their places, as a sentence begins."""
    text = ", ".join(item.candidate.label for item in found)
    return text[:1].upper() + text[1:]
