"""The whole diagnosis: search, closed-loop confirmation against rivals, verdict."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from discrepancy import rules
from discrepancy.engine.confirm import Alternative, confirm, labels, not_simulated
from discrepancy.engine.explanation import Explanation, Found
from discrepancy.engine.gain import Gain, responses
from discrepancy.engine.refit import only
from discrepancy.engine.search import search
from discrepancy.engine.verdict import Verdict, only_add_up, verdict_of
from discrepancy.rig import Rig


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
    transients = [found for found in explanation.found if found.candidate.transient]
    if only_add_up(explanation) and len(transients) == 1:
        explanation, note = _without_transient(rig, explanation)
        notes.append(note)
    why_not = rig.can_resimulate() if closed_loop else "the closed loop was left out on request"
    alternatives = tuple(not_simulated(found) for found in explanation.found)
    gain: Gain | None = None
    if why_not is None and explanation.found:
        if say:
            say("simulate")
        confirmed = confirm(rig, explanation, jobs, simulated)
        explanation, alternatives, gain = confirmed.explanation, confirmed.alternatives, confirmed.gain
        notes += confirmed.notes
    elif why_not is None:
        before = responses(rig, explanation.problem, [[]], jobs, simulated)[0]
        gain = Gain(before, before, len(rig.trials) > 1)
    verdict = verdict_of(explanation)
    if verdict == "unexplained" and explanation.found:
        explanation, note = _without_suspects(rig, explanation)
        notes.append(note)
        alternatives = ()
        gain = None if gain is None else Gain(gain.before, gain.before, gain.held_out)
    if explanation.found and why_not is not None:
        notes.append(
            f"The named causes were not tried in closed loop ({why_not}), so look-alikes that only the response to "
            "the commands separates remain possible."
        )
    if len(rig.trials) == 1:
        notes.append("One trial only: nothing could be validated on data that was not used for the fit.")
    return Diagnosis(verdict, explanation, alternatives, gain, why_not, tuple(notes))


def _without_transient(rig: Rig, explanation: Explanation) -> tuple[Explanation, str]:
    """Two causes at one place are believed without the event that took what they left."""
    gone = [found for found in explanation.found if found.candidate.transient]
    kept = [found for found in explanation.found if not found.candidate.transient]
    note = f"{labels(gone)}: takes what the other causes leave at one place, so it is not named."
    return only(rig, explanation, kept), note


def _without_suspects(rig: Rig, explanation: Explanation) -> tuple[Explanation, str]:
    """No forced choice: causes that explain too little are not named."""
    if only_add_up(explanation):
        why = "only all together fit, as if they imitated something else, so none is named."
    else:
        why = f"explains only {100 * explanation.explained:.0f} % of the misfit, so it is not named."
    rejected = (*explanation.rejected, *(found.candidate for found in explanation.found))
    nothing = replace(only(rig, explanation, []), rejected=rejected)
    return nothing, f"{labels(explanation.found)}: {why}"
