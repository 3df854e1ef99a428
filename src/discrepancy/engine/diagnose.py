"""The whole diagnosis: the likeliest hypothesis, its test in the closed loop, the verdict."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from discrepancy import rules
from discrepancy.engine.confirm import Alternative, confirm, labels, not_simulated
from discrepancy.engine.explanation import Explanation, Found, explain
from discrepancy.engine.gain import responses, with_all_as_found
from discrepancy.engine.lawful import laws_of, refining, responding
from discrepancy.engine.verdict import Verdict, verdict_of
from discrepancy.inference.odds import check_odds
from discrepancy.inference.search import Searched, continued, search
from discrepancy.laws.instead import LawFirst, in_place
from discrepancy.laws.lines import line_nats
from discrepancy.laws.search import Lawful, with_laws
from discrepancy.laws.where import Located
from discrepancy.rig import Rig
from discrepancy.team.gain import Gain

When = Literal["auto", "always", "never"]


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """The verdict and what it rests on.

    Attributes:
        rig: what was diagnosed, linear around where it is.
        verdict: one of the five.
        explanation: the search's result, causes in the order of discovery.
        alternatives: per cause, its rivals.
        gain: closed-loop responses without and with the causes, or None.
        not_simulated: why there is no closed-loop comparison, or None.
        notes: sentences about what the data could not decide or validate.
        located: where something unlisted was looked for, the likeliest place first; empty where nothing unlisted is.
    """

    rig: Rig
    verdict: Verdict
    explanation: Explanation
    alternatives: tuple[tuple[Alternative, ...], ...]
    gain: Gain | None
    not_simulated: str | None
    notes: tuple[str, ...]
    located: tuple[Located, ...] = ()

    @property
    def causes(self) -> tuple[Found, ...]:
        """The named causes."""
        return self.explanation.found


def diagnose(
    rig: Rig,
    *,
    closed_loop: bool = True,
    most: int = rules.MOST_CAUSES,
    laws: When = "auto",
    odds: float = rules.PRIOR_ODDS,
    searched: Searched | None = None,
    jobs: int = 1,
    say: Callable[[str], object] | None = None,
    simulated: Callable[[int], object] | None = None,
) -> Diagnosis:
    """Diagnose a rig's recordings.

    Args:
        rig: recordings and causes.
        closed_loop: whether to resimulate the recorded commands.
        most: largest number of causes.
        laws: whether to look for laws that the catalogue lacks: where something unlisted is left, a named cause is
            not sure, or several are at one joint; always; or never.
        odds: of any cause being there before the data are seen, at all its places together.
        searched: what a search with these odds found, where there was one.
        jobs: parallel processes of the simulations.
        say: called with what is being done.
        simulated: called with 1 for every simulated trial.

    Raises:
        InputError: the odds are none.
    """
    first = LawFirst(say)
    if searched is None:
        searched = search(rig, most, say, check_odds(odds), None if laws == "never" else first)
        searched = first.known_to(searched)
    explanation = listed = explain(searched)
    notes: list[str] = []
    located = first.places
    laws_there = laws_of(explanation)
    unsure = any(f.probability < rules.LAW_INSTEAD for f in explanation.found if f not in laws_there)
    lawful: Lawful | None = None
    doubtful = unsure or not explanation.clean or explanation.unlisted_nats >= rules.DOUBT_NATS
    if rig.bench is not None and not doubtful:
        doubtful = line_nats(searched.best.fit, rig.bench) >= rules.UNLISTED_NATS
    if laws == "always" or (laws == "auto" and doubtful):
        lawful = with_laws(searched, most, say, always=laws == "always", instead=unsure)
    if (
        laws == "auto"
        and explanation.clean
        and not unsure
        and (lawful is None or lawful.searched.best is searched.best)
    ):
        lawful = in_place(searched, say) or lawful
    if lawful is not None:
        searched, located = lawful.searched, located or lawful.places
        explanation = explain(searched)
        notes += refining(lawful.refinements, explanation)
    rig = searched.rig
    why_not = rig.can_resimulate() if closed_loop else "the closed loop was left out on request"
    if why_not is None and laws_of(explanation):
        if first.cause is not None:
            listed = explain(first.cause)
        if say:
            say("simulate")
        explanation, spoken = responding(rig, listed, explanation, jobs, simulated)
        if spoken and first.cause is not None:
            explanation = explain(continued(first.cause, most, say or (lambda what: None)))
        notes += spoken
    if odds != rules.PRIOR_ODDS:
        notes.append(
            f"Every cause was taken to be there with odds of {odds:g} beforehand; otherwise it is {rules.PRIOR_ODDS:g}."
        )
    alternatives = tuple(not_simulated(found) for found in explanation.found)
    gain, contradicted = None, False
    if why_not is None and explanation.found:
        if say:
            say("simulate")
        confirmed = confirm(rig, explanation, jobs, simulated)
        explanation, alternatives, gain = confirmed.explanation, confirmed.alternatives, confirmed.gain
        contradicted = confirmed.contradicted
        notes += confirmed.notes
    elif why_not is None:
        before = responses(rig, explanation.problem, [[]], jobs, simulated)[0]
        gain = Gain(before, before, len(rig.trials) > 1)
    if gain is not None:
        free = explanation.fit.free
        gain = with_all_as_found(gain, rig, explanation.problem, free, jobs, simulated)
    notes += [
        f"{labels([found])}: as the others tell it, {rig.trials[int(np.argmin(found.folds))]} is less likely with it, "
        f"by {-min(found.folds):.0f} nats; beside what is not explained that speaks against it."
        for found in (*explanation.found, *explanation.suspected)
        if found.contradicted
    ]
    verdict = verdict_of(explanation)
    if contradicted and verdict == "explained":
        verdict = "partly_explained"
    if explanation.found and why_not is not None:
        notes.append(
            f"The named causes were not tried in closed loop ({why_not}), so look-alikes that only the response to "
            "the commands separates remain possible."
        )
    if len(rig.trials) == 1:
        notes.append("One trial only: nothing could be validated on data that was not used for the fit.")
    return Diagnosis(rig, verdict, explanation, alternatives, gain, why_not, tuple(notes), located)
