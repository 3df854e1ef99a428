"""Search some parts of long recordings, and hold what is found against the others."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from discrepancy import rules
from discrepancy.engine.explanation import explain
from discrepancy.inference.search import Searched, search
from discrepancy.team.long.choice import Choice
from discrepancy.team.long.left import Left, more_left, times_as_much
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
            odd, ratio = _against(choice, searched)
        except InputError:  # no such robots
            note = "What was found is no team that can be, so it was not held against the other parts."
            return SearchedParts(choice, searched, (note,))
        room = most - len(choice.taken)
        if not odd or room <= 0:
            return SearchedParts(choice, searched, _said(choice, odd, ratio))
        worst = sorted(odd, key=lambda k: -odd[k])[:room]
        choice = choice.beside(worst)
        if not choice.others:
            return SearchedParts(choice, search(rig_of(choice.searched), progress=say, odds=odds), ())


def _against(choice: Choice, searched: Searched) -> tuple[dict[int, float], float | None]:
    """Parts in which more is left than in any that was searched, by number, and by how much all others leave more.

    Raises:
        InputError: there are no such robots.
    """
    rig = searched.rig
    assert isinstance(rig, TeamRig)
    found = rig.as_found(explain(searched))
    left = {k: Left.of(*rig.left_in(part, found)) for k, part in enumerate(choice.parts)}
    known = [left[k] for k in choice.taken]
    others = {k: left[k] for k in choice.others}
    odd = {k: by for k, by in more_left(others, known).items() if by > 1.0}
    return odd, times_as_much(list(others.values()), known)


def _said(choice: Choice, odd: dict[int, float], ratio: float | None) -> tuple[str, ...]:
    searched = "the parts that were not searched"
    notes = [] if ratio is None else [
        f"In {searched} what was found leaves {ratio:.2f} times as much as in those that were."
    ]  # fmt: skip
    if not odd:
        return (*notes, f"In none of {searched} is so much more left that something else had to be there.")
    worst = sorted(odd, key=lambda k: -odd[k])
    names = "; ".join(choice.parts[k].name for k in worst[: rules.ODD_NAMED])
    more = f", and {len(odd) - rules.ODD_NAMED} more" if len(odd) > rules.ODD_NAMED else ""
    return (
        *notes,
        f"Something else is in {len(odd)} of {searched}: {names}{more}. Diagnose these by themselves, or all with "
        "--whole.",
    )
