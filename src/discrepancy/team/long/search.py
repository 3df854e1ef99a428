"""Search some parts of long recordings, and hold what is found against the others."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from discrepancy import rules
from discrepancy.engine.explanation import Explanation, explain
from discrepancy.inference.search import Searched, search
from discrepancy.team.long.choice import Choice
from discrepancy.team.long.left import Left, more_left, typical
from discrepancy.team.rig import TeamRig
from estimator.errors import InputError
from estimator.recording.model import Recording


@dataclass(frozen=True, eq=False)
class SearchedParts:
    """What a search of some parts found.

    Attributes:
        choice: the parts.
        searched: the result.
        notes: sentences about the others.
    """

    choice: Choice
    searched: Searched
    notes: tuple[str, ...]


def search_parts(
    choice: Choice, rig_of: Callable[[list[Recording]], TeamRig], odds: float, say: Callable[[str], object]
) -> SearchedParts:
    """Search the parts that are taken, and those in which more is left than in these, too, until there are none.

    Args:
        choice: the parts, not all of which are taken.
        rig_of: makes the rig of some.
        odds: of any cause being there before the data are seen.
        say: takes the name of the stage that begins.
    """
    most = 2 * len(choice.taken)
    while True:
        searched = search(rig_of(choice.searched), progress=say, odds=odds)
        say("hold against the other parts")
        try:
            against = _against(choice, searched)
        except InputError:  # no such robots
            note = "What was found is no team that can be, so it was not held against the other parts."
            return SearchedParts(choice, searched, (note,))
        odd, ratio = against
        room = most - len(choice.taken)
        if not odd or room <= 0:
            return SearchedParts(choice, searched, _said(choice, odd, ratio))
        worst = sorted(odd, key=lambda k: -odd[k])[:room]
        choice = choice.beside(worst)
        if not choice.others:
            return SearchedParts(choice, search(rig_of(choice.searched), progress=say, odds=odds), ())


def _against(choice: Choice, searched: Searched) -> tuple[dict[int, float], float]:
    """Parts in which more is left than in any that was searched, by number, and by how much all others leave more.

    Raises:
        InputError: there are no such robots.
    """
    rig = searched.rig
    assert isinstance(rig, TeamRig)
    explanation: Explanation = explain(searched)
    found = rig.as_found(explanation)
    left = {k: Left.of(*rig.left_in(part, found)) for k, part in enumerate(choice.parts)}
    known = [left[k] for k in choice.taken]
    more = more_left({k: left[k] for k in choice.others}, known)
    others = typical([left[k] for k in choice.others]) / np.maximum(typical(known), 1e-300)
    return {k: by for k, by in more.items() if by > 1.0}, float(np.sqrt(np.median(others)))


def _said(choice: Choice, odd: dict[int, float], ratio: float) -> tuple[str, ...]:
    text = f"In the parts that were not searched what was found leaves {ratio:.2f} times as much as in those that were"
    if not odd:
        return (f"{text}, and nowhere so much more that something else had to be there.",)
    worst = sorted(odd, key=lambda k: -odd[k])
    names = "; ".join(choice.parts[k].name for k in worst[: rules.ODD_NAMED])
    more = f", and {len(odd) - rules.ODD_NAMED} more" if len(odd) > rules.ODD_NAMED else ""
    return (
        f"{text}, but something else is in {len(odd)} of them: {names}{more}. Diagnose these by themselves, or "
        "all with --whole.",
    )
