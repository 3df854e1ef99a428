"""Parts of which a team has one only."""

from __future__ import annotations

from collections import Counter

from discrepancy.team.problem import team_problem
from test_origin import team


def test_a_kind_with_one_place_has_no_spread_of_its_own(case) -> None:
    """A spread learnt from a single part explains any fault of it, and the fault is never named."""
    problem = team_problem(team(case))
    places = Counter(g.cause for g in problem.groups)
    kin = {k for family in problem.families for k in family}
    assert places["drag"] == 1
    assert places["grasp_play"] > 1
    for group in problem.groups:
        assert kin.issuperset(group.columns) == (places[group.cause] > 1), group.cause
