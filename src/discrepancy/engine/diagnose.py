"""The whole diagnosis: search, closed-loop confirmation against rivals, verdict."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from discrepancy import rules
from discrepancy.engine.explanation import Explanation, Found
from discrepancy.engine.gain import Gain, Response, mean_chi2, responses
from discrepancy.engine.search import refitted, search, without_idle
from discrepancy.rig import Candidate, Rig

Verdict = Literal["consistent", "explained", "partly_explained", "unexplained"]


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
class Diagnosis:
    """The verdict and what it rests on.

    Attributes:
        verdict: one of the four.
        explanation: the search's result, causes in the order of discovery.
        alternatives: per cause, its rivals.
        gain: closed-loop responses without and with the causes, or None.
        not_simulated: why there is no closed-loop comparison, or None.
        notes: sentences about what the data could not decide or validate.
    """

    verdict: Verdict
    explanation: Explanation
    alternatives: tuple[tuple[Alternative, ...], ...]
    gain: Gain | None
    not_simulated: str | None
    notes: tuple[str, ...]

    @property
    def causes(self) -> tuple[Found, ...]:
        """The named causes."""
        return self.explanation.found


def diagnose(
    rig: Rig,
    *,
    closed_loop: bool = True,
    most: int = rules.MOST_CAUSES,
    jobs: int = 1,
    say: Callable[[str], object] | None = None,
    simulated: Callable[[int], object] | None = None,
) -> Diagnosis:
    """Diagnose a rig's recordings.

    Args:
        rig: recordings and causes.
        closed_loop: whether to resimulate the recorded commands.
        most: largest number of causes; more than the default where the nominal model leaves out much on purpose.
        jobs: parallel processes of the simulations.
        say: called with what is being done.
        simulated: called with 1 for every simulated trial.
    """
    explanation = search(rig, most, progress=say)
    notes: list[str] = []
    if (
        _add_up(explanation)
        and sum(found.candidate.transient is not None for found in explanation.found) == 1
    ):
        explanation, note = _without_transient(rig, explanation)
        notes.append(note)
    why_not = rig.can_resimulate() if closed_loop else "the closed loop was left out on request"
    alternatives: list[tuple[Alternative, ...]] = [_unsimulated(found) for found in explanation.found]
    gain: Gain | None = None
    if why_not is None and explanation.found:
        if say:
            say("simulate")
        explanation, alternatives, gain, said = _confirm(rig, explanation, jobs, simulated)
        notes += said
    elif why_not is None:
        before = responses(rig, explanation.problem, [[]], jobs, simulated)[0]
        gain = Gain(before, before, len(rig.trials) > 1)
    verdict = _verdict(explanation)
    if verdict == "unexplained" and explanation.found:
        explanation, note = _without_suspects(rig, explanation)
        notes.append(note)
        alternatives = []
        gain = None if gain is None else Gain(gain.before, gain.before, gain.held_out)
    if explanation.found and why_not is not None:
        notes.append(
            f"The named causes were not tried in closed loop ({why_not}), so look-alikes that only the response to "
            "the commands separates remain possible."
        )
    if len(rig.trials) == 1:
        notes.append("One trial only: nothing could be validated on data that was not used for the fit.")
    return Diagnosis(verdict, explanation, tuple(alternatives), gain, why_not, tuple(notes))


def _unsimulated(found: Found) -> tuple[Alternative, ...]:
    return tuple(Alternative(c, gap, None, gap < rules.AMBIGUOUS_NATS) for c, gap in found.rivals)


def _verdict(explanation: Explanation) -> Verdict:
    if not explanation.found:
        return "consistent" if explanation.clean else "unexplained"
    if _add_up(explanation):
        return "unexplained"
    if explanation.clean or explanation.explained >= rules.EXPLAINED_SHARE:
        return "explained"
    return "partly_explained" if explanation.explained >= rules.LEAST_SHARE else "unexplained"


def _add_up(explanation: Explanation) -> bool:
    """Three causes at one robot, or that look alike, imitate another that the catalogue does not have."""
    robots = {found.candidate.robot for found in explanation.found} - {None}
    families = {found.candidate.family for found in explanation.found}
    # Where no cause has a robot, all are at one place anyway, and only their families tell.
    placed = any(candidate.robot for candidate in explanation.problem.candidates)
    few = rules.MOST_BELIEVED
    return len(explanation.found) > few and ((placed and len(robots) <= 1) or len(families) <= few)


def _without_transient(rig: Rig, explanation: Explanation) -> tuple[Explanation, str]:
    """Two causes at one place are believed without the event that took what they left."""
    gone = [found.candidate for found in explanation.found if found.candidate.transient]
    both = zip(explanation.found, explanation.fit.free, strict=True)
    kept = [(found, index) for found, index in both if not found.candidate.transient]
    rest = replace(explanation, found=tuple(found for found, _ in kept))
    labels = ", ".join(candidate.label for candidate in gone)
    note = f"{labels}: takes what the other causes leave at one place, so it is not named."
    return refitted(rig, rest, [index for _, index in kept]), note


def _without_suspects(rig: Rig, explanation: Explanation) -> tuple[Explanation, str]:
    """No forced choice: causes that explain too little are not named."""
    labels = ", ".join(found.candidate.label for found in explanation.found)
    if _add_up(explanation):
        note = f"{labels}: only all together fit, as if they imitated something else, so none is named."
    else:
        note = (
            f"{labels}: explains only {100 * explanation.explained:.0f} % of the misfit, so it is not named."
        )
    rejected = (*explanation.rejected, *(found.candidate for found in explanation.found))
    return replace(refitted(rig, explanation, []), rejected=rejected), note


def _confirm(
    rig: Rig, explanation: Explanation, jobs: int, simulated: Callable[[int], object] | None
) -> tuple[Explanation, list[tuple[Alternative, ...]], Gain, list[str]]:
    """Simulate without causes, with them, and with each close rival in a cause's place; keep what does best."""
    notes: list[str] = []
    problem = explanation.problem
    free = list(explanation.fit.free)
    hypotheses: list[list[int]] = [[], free]
    trials: list[tuple[int, Candidate, float]] = []  # place in free, rival, gap
    for place, found in enumerate(explanation.found):
        for rival, gap in found.rivals:
            index = problem.index_of(rival)
            if index is None or index in free or gap > rules.CLOSE_NATS or rival.transient:
                continue
            problem = problem.with_columns(index, rival, rig.columns(rival))
            trials.append((place, rival, gap))
            hypotheses.append([*free[:place], index, *free[place + 1 :]])
    first = [found.candidate.key for found in explanation.found]
    results = responses(rig, problem, hypotheses, jobs, simulated)
    before, after, others = results[0], results[1], results[2:]
    chosen, best = free, mean_chi2(after)
    for (place, rival, _), hypothesis, result in zip(trials, hypotheses[2:], others, strict=True):
        value = mean_chi2(result)
        if value < best * (1.0 - rules.MARGIN_SHARE) and _wins(result, after):
            named = explanation.found[place].candidate
            notes.append(
                f"The rows alone could not tell {named.label} from {rival.label}; in closed loop the latter does "
                f"better (chi2/n {value:.3g} against {best:.3g})."
            )
            chosen, best, after = hypothesis, value, result
    kept = list(range(len(free)))
    if chosen is not free:
        explanation = refitted(rig, replace(explanation, problem=problem), chosen)
        labels = [found.candidate.label for found in explanation.found]
        explanation, kept = without_idle(rig, explanation)
        if len(kept) < len(free):
            gone = ", ".join(label for place, label in enumerate(labels) if place not in kept)
            notes.append(f"{gone}: tells nothing any more beside that, so it is not named.")
            after = responses(rig, explanation.problem, [explanation.fit.free], jobs, simulated)[0]
    none, ours = mean_chi2(before), mean_chi2(after)
    idle = none > rules.VISIBLE_CHI2_PER_N and ours > none * (1.0 - rules.LEAST_SHARE)
    if ours > none * (1.0 + rules.MARGIN_SHARE) or idle:
        dropped = ", ".join(found.candidate.label for found in explanation.found)
        notes.append(f"{dropped}: {_in_closed_loop(none, ours)}, so it is not named.")
        after, chosen = before, []
        explanation = refitted(rig, explanation, [])
    tried = {(p, c.key): mean_chi2(r) for (p, c, _), r in zip(trials, others, strict=True)}
    tried |= {(p, c): mean_chi2(results[1]) for p, c in enumerate(first)}
    alternatives = []
    for place, found in zip(kept, explanation.found, strict=False):
        listed = []
        for rival, gap in found.rivals:
            value = tried.get((place, rival.key))
            apart = value is not None and value > best * (1.0 + rules.MARGIN_SHARE)
            listed.append(Alternative(rival, gap, value, gap < rules.AMBIGUOUS_NATS and not apart))
        alternatives.append(tuple(listed))
    return explanation, alternatives, Gain(before, after, len(rig.trials) > 1), notes


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
