"""Search some parts of long recordings, and hold what is found against the others."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from discrepancy.team.long.choice import Choice
from discrepancy.team.long.left import Left, more_left, times_as_much
from discrepancy.team.rig import AsFound, TeamRig
from estimator.errors import InputError
from estimator.recording.model import Recording

ODD_NAMED = 3
"""Of such parts that were not searched all the same, how many are named. Chosen."""

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class SearchedParts(Generic[T]):
    """What a search of some parts found.

    Attributes:
        choice: the parts.
        searched: the result.
        notes: sentences about the others.
    """

    choice: Choice
    searched: T
    notes: tuple[str, ...]


def search_parts(
    choice: Choice,
    search: Callable[[list[Recording]], T],
    found: Callable[[T], tuple[TeamRig, AsFound]],
    say: Callable[[str], object],
) -> SearchedParts[T]:
    """Search the parts that are taken, and those in which more is left than in these, too, until there are none.

    Args:
        choice: the parts, not all of which are taken.
        search: of some.
        found: the rig of a result, and what is found; it raises an ``InputError`` where there are no such robots.
        say: takes the name of the stage that begins.
    """
    most = 2 * len(choice.taken)
    while True:
        searched = search(choice.searched)
        say("hold against the other parts")
        try:
            odd, ratio = _against(choice, *found(searched))
        except InputError:  # no such robots
            note = "What was found is no team that can be, so it was not held against the other parts."
            return SearchedParts(choice, searched, (note,))
        room = most - len(choice.taken)
        if not odd or room <= 0:
            return SearchedParts(choice, searched, _said(choice, odd, ratio))
        worst = sorted(odd, key=lambda k: -odd[k])[:room]
        choice = choice.beside(worst)
        if not choice.others:
            return SearchedParts(choice, search(choice.searched), ())


def _against(choice: Choice, rig: TeamRig, found: AsFound) -> tuple[dict[int, float], float | None]:
    """Parts in which more is left than in any that was searched, by number, and by how much all others leave more."""
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
    names = "; ".join(choice.parts[k].name for k in worst[:ODD_NAMED])
    more = f", and {len(odd) - ODD_NAMED} more" if len(odd) > ODD_NAMED else ""
    return (
        *notes,
        f"Something else is in {len(odd)} of {searched}: {names}{more}. Diagnose these by themselves, or all with "
        "--whole.",
    )
