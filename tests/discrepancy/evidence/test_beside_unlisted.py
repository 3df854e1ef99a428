"""What is left beside a law that was fitted, not derived."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from discrepancy.evidence.cells import Bands, Cells
from discrepancy.evidence.posterior import Group
from discrepancy.evidence.probability import without_unfounded
from discrepancy.evidence.search import Chosen, Search
from estimator.arrays import Array
from test_evidence_search import EDGES_HZ, LENGTH, RATE_HZ, Machine, wave


@pytest.mark.parametrize(
    ("size", "unlisted", "stays"), [(0.2, True, False), (4.0, True, True), (0.2, False, True)]
)
def test_an_event_beside_an_unlisted_law_must_explain_half_as_much(
    size: float, unlisted: bool, stays: bool
) -> None:
    """Both fit exactly: what the first one is decides whether a small second one is believed."""
    rng = np.random.default_rng(9)
    x, other = wave(rng), wave(rng)
    y = 5.0 * x + size * other + 0.05 * rng.standard_normal(LENGTH)
    cells = Cells.of(Bands([RATE_HZ], [LENGTH], EDGES_HZ), [y[:, None]])
    cells.add([{0: [x]}, {0: [other]}])
    first = Group("first", "joint", (0,), (5.0,), late=unlisted)
    event = Group("push", "joint", (1,), (5.0,), event=True)
    search = Search(Machine(cells, [first, event]), np.full((1, 3), 0.05**2))
    state = search.settled(search.value([Chosen(first, 1.0), Chosen(event, 1.0)], None))
    assert (("push", "joint") in without_unfounded(search, state).keys) == stays


def test_a_part_without_kin_is_usual_where_the_machine_is_as_far_off() -> None:
    """Its own kind has no other place to learn from."""
    rng = np.random.default_rng(10)
    columns = [wave(rng) for _ in range(5)]
    y = 10.0 * sum(columns[:4]) + 12.0 * columns[4] + 0.05 * rng.standard_normal(LENGTH)
    cells = Cells.of(Bands([RATE_HZ], [LENGTH], EDGES_HZ), [y[:, None]])
    cells.add([{0: [x]} for x in columns])

    class Tolerated(Machine):
        def prior(self, chosen: Sequence[Chosen], values: Array | None) -> Array:
            return np.ones(5)

    groups = [Group("kin", f"joint {k}", (k,), (64.0,)) for k in range(4)]
    groups.append(Group("single", "payload", (4,), (64.0,)))
    search = Search(Tolerated(cells, groups, families=[[0, 1, 2, 3]]), np.full((1, 3), 0.05**2))
    state = search.settled(search.value([Chosen(groups[-1], 1.0)], None))
    assert search.is_within_tolerance(state, state.chosen[0])
