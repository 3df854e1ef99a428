"""Named causes and their rivals in the closed loop: what responds best stays."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from discrepancy import rules
from discrepancy.engine.explanation import Explanation, Found
from discrepancy.engine.gain import Gain, Response, mean_chi2, responses
from discrepancy.engine.refit import only, with_rival, without_idle
from discrepancy.least_squares.problem import Problem
from discrepancy.rig import Candidate, Rig


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
        explanation: with what responds best.
        alternatives: per cause, its rivals.
        gain: responses without and with the causes.
        notes: sentences about what was replaced or dropped.
    """

    explanation: Explanation
    alternatives: tuple[tuple[Alternative, ...], ...]
    gain: Gain
    notes: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Swap:
    """A rival in the place of a named cause.

    Attributes:
        cause: the named one.
        rival, index: the other, and which candidate of the problem it is.
        free: indices of all causes of this hypothesis.
    """

    cause: Found
    rival: Candidate
    index: int
    free: tuple[int, ...]


def confirm(
    rig: Rig, explanation: Explanation, jobs: int = 1, simulated: Callable[[int], object] | None = None
) -> Confirmed:
    """Simulate without causes, with them, and with each close rival in a cause's place; keep what does best.

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
    tried = {(found.index, found.candidate.key): mean_chi2(after) for found in explanation.found}
    notes: list[str] = []
    best, winner = mean_chi2(after), None
    for swap, response in zip(swaps, others, strict=True):
        value = mean_chi2(response)
        tried[swap.cause.index, swap.rival.key] = value
        if value < best * (1.0 - rules.MARGIN_SHARE) and _wins(response, after):
            notes.append(
                f"The rows alone could not tell {swap.cause.candidate.label} from {swap.rival.label}; in closed loop "
                f"the latter does better (chi2/n {value:.3g} against {best:.3g})."
            )
            best, winner, after = value, swap, response
    if winner is not None:
        swapped = with_rival(rig, explanation, problem, winner.cause, winner.index)
        explanation = without_idle(rig, swapped)
        kept = {found.index for found in explanation.found}
        gone = [found for found in swapped.found if found.index not in kept]
        if gone:
            notes.append(f"{labels(gone)}: tells nothing any more beside that, so it is not named.")
            after = responses(rig, explanation.problem, [explanation.fit.free], jobs, simulated)[0]
    none, ours = mean_chi2(before), mean_chi2(after)
    useless = none > rules.VISIBLE_CHI2_PER_N and ours > none * (1.0 - rules.LEAST_SHARE)
    if useless or ours > none * (1.0 + rules.MARGIN_SHARE):
        notes.append(f"{labels(explanation.found)}: {_in_closed_loop(none, ours)}, so it is not named.")
        after, explanation = before, only(rig, explanation, [])
    alternatives = []
    for found in explanation.found:
        place = winner.cause.index if winner and found.index == winner.index else found.index
        alternatives.append(
            tuple(_alternative(c, gap, tried.get((place, c.key)), best) for c, gap in found.rivals)
        )
    gain = Gain(before, after, len(rig.trials) > 1)
    return Confirmed(explanation, tuple(alternatives), gain, tuple(notes))


def _alternative(rival: Candidate, gap: float, chi2_per_n: float | None, best: float) -> Alternative:
    apart = chi2_per_n is not None and chi2_per_n > best * (1.0 + rules.MARGIN_SHARE)
    return Alternative(rival, gap, chi2_per_n, gap < rules.AMBIGUOUS_NATS and not apart)


def not_simulated(found: Found) -> tuple[Alternative, ...]:
    """A cause's rivals by the rows alone."""
    return tuple(_alternative(rival, gap, None, np.inf) for rival, gap in found.rivals)


def _swaps(rig: Rig, explanation: Explanation) -> tuple[Problem, list[Swap]]:
    """Rivals that the rows put close to a cause, each in its place, and the problem with their best columns."""
    problem, free, swaps = explanation.problem, explanation.fit.free, []
    for found in explanation.found:
        for rival, gap in found.rivals:
            index = problem.index_of(rival)
            if index is None or index in free or gap > rules.CLOSE_NATS or rival.transient:
                continue
            problem = problem.with_columns(index, rival, rig.columns(rival))
            swapped = tuple(index if i == found.index else i for i in free)
            swaps.append(Swap(found, rival, index, swapped))
    return problem, swaps


def labels(found: Iterable[Found]) -> str:
    """Causes and their places, as a sentence begins."""
    text = ", ".join(item.candidate.label for item in found)
    return text[:1].upper() + text[1:]


def _in_closed_loop(before: float, after: float) -> str:
    """What named causes do to the response, by its chi-square without and with them."""
    if not np.isfinite(after):
        return "with it the recorded commands cannot be simulated"
    if after < before:
        effect = "hardly improves the response to the commands"
    else:
        effect = "makes the response to the commands worse"
    return f"{effect} (chi2/n {before:.3g} to {after:.3g})"


def _wins(rival: Sequence[Response | None], named: Sequence[Response | None]) -> bool:
    """Whether the rival is better on most trials, not on one by much."""
    better = [
        a is not None and (b is None or a.chi2_per_n < b.chi2_per_n)
        for a, b in zip(rival, named, strict=True)
    ]
    return float(np.mean(better)) >= rules.WINNING_SHARE
