"""Laws that are not stated after all: forms of what is listed, and what makes the response to the commands worse."""

from collections.abc import Callable, Iterable

import numpy as np

from discrepancy import rules
from discrepancy.digits import three_digits
from discrepancy.engine.confirm import labels
from discrepancy.engine.explanation import Explanation, Found
from discrepancy.engine.gain import responses
from discrepancy.laws.candidate import LawCandidate
from discrepancy.laws.forms import Refinement
from discrepancy.rig import Rig
from discrepancy.team.gain import mean_chi2


def laws_of(explanation: Explanation) -> list[Found]:
    """The laws among what is named."""
    return [found for found in explanation.found if isinstance(found.candidate, LawCandidate)]


def refining(refinements: Iterable[Refinement], explanation: Explanation) -> list[str]:
    """A sentence for every law that is a form of what is listed, once, unless it is stated after all."""
    stated = {found.candidate.key for found in laws_of(explanation)}
    said = {one.law.key: one.sentence for one in refinements if one.law.key not in stated}
    return list(said.values())


def responding(
    rig: Rig, listed: Explanation, lawful: Explanation, jobs: int = 1,
    simulated: Callable[[int], object] | None = None,
) -> tuple[Explanation, list[str]]:  # fmt: skip
    """The explanation with laws where the simulated response is no worse for them, otherwise that without.

    Rows are filtered: an error of their own, such as where smoothed velocities turn round, can be put into a formula
    as well as one of the machine. A simulation is not filtered.

    Args:
        rig: that can simulate.
        listed: what the catalogue alone can do.
        lawful: with laws.
        jobs: parallel processes.
        simulated: called with 1 for every simulated trial.

    Returns:
        the explanation, and a sentence where laws were left out.
    """
    without, with_ = (
        mean_chi2(responses(rig, each.problem, [each.fit.free], jobs, simulated)[0])
        for each in (listed, lawful)
    )
    if not np.isfinite(without) or with_ <= without * (1.0 + rules.MARGIN_SHARE):
        return lawful, []
    worse = (
        f"(chi2/n {three_digits(without)} to {three_digits(with_)})"
        if np.isfinite(with_)
        else "(it cannot be simulated)"
    )
    return listed, [
        f"{labels(laws_of(lawful))}: a formula fits what is left, but makes the response to the commands worse "
        f"{worse}, so none is stated."
    ]
