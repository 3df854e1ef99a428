"""From recordings of a team to the likeliest causes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

from discrepancy.evidence.search import Search, State
from discrepancy.evidence.settings import SETTINGS, Settings
from discrepancy.evidence.until import Until
from discrepancy.team.around import (
    STRAIGHT_CHI2_PER_N,
    around,
    bent,
    exact,
    opened_by,
    placed,
)
from discrepancy.team.problem import TeamProblem, team_problem
from discrepancy.team.rig import TeamRig
from estimator.errors import InputError

LEAVE_OPEN = ("joint_friction", "gimbal_friction", "sea_hysteresis", "grasp_play")
"""Causes after which rows have another noise: a search goes on only beside what they leave open."""


@dataclass(frozen=True, eq=False)
class TeamOutcome:
    """What a search found.

    Attributes:
        problem: linear around what was found.
        search: on it.
        state: the likeliest set.
        nothing: the search and the state without causes, around the robots as they are found without.
        finished: whether the search came to its end.
    """

    problem: TeamProblem
    search: Search
    state: State
    nothing: tuple[Search, State]
    finished: bool = True

    @property
    def rig(self) -> TeamRig:
        """The recordings, linear around what was found, and their simulator."""
        return self.problem.rig


def search_team(
    rig: TeamRig, settings: Settings = SETTINGS, say: Callable[[str], object] = lambda _: None,
    until: Until | None = None,
) -> TeamOutcome:  # fmt: skip
    """The likeliest causes of what a team's model leaves of its recordings."""
    until = until or Until()
    problem = team_problem(rig)
    search = Search(problem, problem.sensors, settings, say, until)
    state = search.fixed(())
    for _ in range(settings.rounds):
        moved = _moved(problem, state)
        if moved is None:
            break
        say("linear around the robots as they are found")
        there = replace(search, problem=moved)
        found = there.fixed(())
        if found.evidence < state.evidence:
            break  # something else pulls at the robots: where they are shows beside it only
        problem, search, state = moved, there, found
    nothing = search, state
    state = until.run(search, state, partial(_beyond, problem))
    for _ in range(2 * settings.rounds):
        if not state.chosen or until():
            break
        before = state.keys
        problem, search, state, same = _beside(problem, search, state)
        if same:
            break
        state = until.run(search, state, partial(_beyond, problem))
        if state.keys == before and not _beyond(problem, state, frozenset()):
            break
    return TeamOutcome(problem, search, state, nothing, not until.broken)


def _beyond(problem: TeamProblem, state: State, new: frozenset[str]) -> bool:
    """Whether a search goes on only in another problem: beside what causes leave open, or linear elsewhere."""
    try:
        return not new.isdisjoint(LEAVE_OPEN) or bent(problem, state)
    except InputError:  # no such robots: what acts on these is not found yet
        return False


def _moved(problem: TeamProblem, state: State) -> TeamProblem | None:
    try:
        return around(problem, state)
    except InputError:  # no such robots: what acts on these is something else
        return None


def _beside(old: TeamProblem, search: Search, state: State) -> tuple[TeamProblem, Search, State, bool]:
    """The same set in a problem that is linear around it, and whether that is the same problem but for little."""
    opened, moved = opened_by(old, state), _moved(old, state)
    problem, same = old, True
    if opened is not None or moved is not None or old.opened is not None:
        near = moved or old
        problem, same = team_problem(near.rig, opened, near.catalogue), False
        search = replace(search, problem=problem, best=None)
        state = search.fixed(placed(problem, old, state.chosen))
    for _ in range(search.settings.rounds):
        problem, miss = exact(problem, state)
        search = replace(search, problem=problem, best=None)
        state = search.settled(search.value(state.chosen, state.posterior))
        if miss < STRAIGHT_CHI2_PER_N:
            break
        same = False
    return problem, search, state, same
