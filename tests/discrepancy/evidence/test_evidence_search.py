"""Noise, errors of laws and edges of logs on problems whose answer is known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import pytest

from discrepancy.evidence.cells import Bands, Cells, Series
from discrepancy.evidence.posterior import Group, Posterior
from discrepancy.evidence.probability import odds_of, without_unfounded
from discrepancy.evidence.search import Chosen, Search, floor_of
from estimator.arrays import Array

RATE_HZ, LENGTH, EDGES_HZ = 100.0, 3000, np.array([0.0, 1.0, 4.0, 10.0])
TIME = np.arange(LENGTH) / RATE_HZ


@dataclass
class Machine:
    """One channel; a cause of one column whose law may have another form."""

    cells: Cells
    groups: list[Group] = field(default_factory=list)
    sensors: Array | None = None
    families: Sequence[Sequence[int]] = ()
    laws: Sequence[Sequence[int]] = ()
    others: Sequence[Array] = ()

    def prior(self, chosen: Sequence[Chosen], values: Array | None) -> Array:
        return np.zeros(self.cells.count)

    def proposals(self, posterior: Posterior, *, late: bool = False) -> list[Group]:
        return []

    def place(self, group: Group) -> Group:
        return group

    def nearby(self, group: Group, posterior: Posterior) -> list[Group]:
        return []

    def forms(self, group: Group, values: Array) -> list[Series]:
        return [{0: [float(values[0]) * x]} for x in self.others]


def wave(rng: np.random.Generator) -> Array:
    """A smooth series of about unit size, below two hertz."""
    f = rng.uniform(0.1, 2.0, 8)
    return np.sin(2.0 * np.pi * TIME[:, None] * f + rng.uniform(0.0, 6.0, 8)).sum(axis=1) / 2.0


def test_the_floor_is_the_noise_however_much_the_dictionary_explains() -> None:
    rng = np.random.default_rng(1)
    noise, columns = 0.02, [wave(rng) for _ in range(6)]
    y = 5.0 * sum(columns) + noise * rng.standard_normal(LENGTH)
    cells = Cells.of(Bands([RATE_HZ], [LENGTH], EDGES_HZ), [y[:, None]])
    cells.add([{0: [x]} for x in columns])
    floor = floor_of(Machine(cells), np.full(6, 100.0))
    assert np.sqrt(floor[0]) == pytest.approx(noise, rel=0.2)


@pytest.mark.parametrize("other", [0.0, 0.1])
def test_the_error_of_a_law_costs_little_where_the_law_is_exact(other: float) -> None:
    """Its share is learnt: small where the law is exact, as large as it is where the law has another form."""
    rng = np.random.default_rng(4)
    x, forms = wave(rng), [wave(rng) for _ in range(8)]
    y = 2.0 * x * 1.0 + 2.0 * other * (rng.standard_normal(8) @ forms) + 0.05 * rng.standard_normal(LENGTH)
    cells = Cells.of(Bands([RATE_HZ], [LENGTH], EDGES_HZ), [y[:, None]])
    cells.add([{0: [x]}])
    machine = Machine(cells, [Group("cause", "joint", (0,), (3.0,))], others=forms)
    search = Search(machine, np.full((1, 3), 0.05**2))
    plain = search.value([Chosen(machine.groups[0], 1.0)], None)
    state = search.settled(search.formed(plain))
    share = np.sqrt(state.posterior.prior[list(state.chosen[0].forms)])
    if other:
        assert share == pytest.approx(0.1, rel=0.6)
        assert state.evidence > plain.evidence + 100.0
    else:
        assert share.max() < 0.01
        assert state.evidence > plain.evidence - 6.0


@pytest.mark.parametrize("kind", ["late", "event"])
def test_laws_and_events_stand_only_for_what_lasting_causes_leave(kind: str) -> None:
    """Their columns span the listed cause, too, so that they alone would be likelier."""
    rng = np.random.default_rng(5)
    x, other = wave(rng), wave(rng)
    y = 5.0 * x + 0.3 * other + 0.05 * rng.standard_normal(LENGTH)
    cells = Cells.of(Bands([RATE_HZ], [LENGTH], EDGES_HZ), [y[:, None]])
    cells.add([{0: [x]}, {0: [x]}, {0: [other]}])
    listed = Group("cause", "joint", (0,), (5.0,))
    second = Group("second", "joint", (1, 2), (5.0, 1.0), late=kind == "late", event=kind == "event")
    search = Search(Machine(cells, [listed, second]), np.full((1, 3), 0.05**2))
    state = search.run(search.value([], None))
    assert state.keys == {("cause", "joint"), ("second", "joint")}


@pytest.mark.parametrize(("size", "usual"), [(2.0, True), (8.0, False)])
def test_what_is_within_three_of_its_kinds_tolerances_is_no_fault(size: float, usual: bool) -> None:
    """However well another shape of it, of which the tolerances know nothing, fits."""
    rng = np.random.default_rng(8)
    columns, other = [wave(rng) for _ in range(4)], wave(rng)
    y = size * other + sum(columns) + 0.05 * rng.standard_normal(LENGTH)
    cells = Cells.of(Bands([RATE_HZ], [LENGTH], EDGES_HZ), [y[:, None]])
    cells.add([{0: [x]} for x in (*columns, other)])

    class Tolerated(Machine):
        def prior(self, chosen: Sequence[Chosen], values: Array | None) -> Array:
            return np.array([1.0, 1.0, 1.0, 1.0, 0.0])

    groups = [Group("cause", f"joint {k}", (k,), (64.0,)) for k in range(4)]
    shape = Group("cause", "joint 0", (4,), (64.0,), shape=(("slow", 1.0),))
    search = Search(Tolerated(cells, groups, families=[[0, 1, 2, 3]]), np.full((1, 3), 0.05**2))
    (odds,) = odds_of(search, search.settled(search.value([Chosen(shape, 1.0)], None)))
    assert odds.over_nothing > 100.0
    assert odds.probability < 1e-3 if usual else odds.probability > 0.999


def test_a_law_that_only_brings_its_errors_is_not_found() -> None:
    """What a tolerance has in full leaves something else, which a law's errors have, and its law has not."""
    rng = np.random.default_rng(5)
    x, other = wave(rng), wave(rng)
    y = 2.0 * x + 0.4 * other + 0.05 * rng.standard_normal(LENGTH)
    cells = Cells.of(Bands([RATE_HZ], [LENGTH], EDGES_HZ), [y[:, None]])
    cells.add([{0: [x]}, {0: [x]}])

    class Tolerated(Machine):
        def prior(self, chosen: Sequence[Chosen], values: Array | None) -> Array:
            return np.array([0.0, 4.0])

    machine = Tolerated(cells, [Group("cause", "joint", (0,), (3.0,))], others=[other])
    search = Search(machine, np.full((1, 3), 0.05**2))
    assert search.fixed([Chosen(machine.groups[0], 1.0)]).chosen == ()


@pytest.mark.parametrize("large", [0.0, 5.0])
def test_a_small_cause_is_sure_alone_and_not_beside_what_a_large_one_may_leave(large: float) -> None:
    rng = np.random.default_rng(6)
    columns = [wave(rng), wave(rng)]
    y = large * columns[0] + 0.0053 * columns[1] + 0.05 * rng.standard_normal(LENGTH)
    cells = Cells.of(Bands([RATE_HZ], [LENGTH], EDGES_HZ), [y[:, None]])
    cells.add([{0: [x]} for x in columns])
    machine = Machine(cells, [Group(name, "joint", (k,), (1.0,)) for k, name in enumerate(("one", "other"))])
    search = Search(machine, np.full((1, 3), 0.05**2))
    wanted = machine.groups if large else machine.groups[1:]
    state = search.settled(search.value([Chosen(g, 1.0) for g in wanted], None))
    *_, small = odds_of(search, state)
    assert 5.0 < small.over_nothing < 9.5
    assert small.probability < 0.5 if large else small.probability > 0.99


def test_of_two_causes_that_are_nearly_alike_one_stays() -> None:
    """Either alone explains what both do, but for a few nats: that there is one of them stays certain."""
    rng = np.random.default_rng(7)
    x, y = wave(rng), wave(rng)
    twin = x + 0.02 * y
    torque = 0.5 * x + 0.005 * y + 0.05 * rng.standard_normal(LENGTH)
    cells = Cells.of(Bands([RATE_HZ], [LENGTH], EDGES_HZ), [torque[:, None]])
    cells.add([{0: [x]}, {0: [twin]}])
    machine = Machine(cells, [Group(name, "joint", (k,), (1.0,)) for k, name in enumerate(("one", "twin"))])
    search = Search(machine, np.full((1, 3), 0.05**2))
    both = search.settled(search.value([Chosen(g, 1.0) for g in machine.groups], None))
    state = without_unfounded(search, both)
    assert len(state.chosen) == 1
    (only,) = odds_of(search, state)
    assert only.over_nothing > 100.0
    assert sum(r.probability for r in only.rivals if r.group is None) < 1e-6


def test_laws_of_other_causes_leave_nothing_that_is_larger_than_they_are() -> None:
    """A tolerance takes it up nearly as well, so little speaks for the cause, but what is there is no law's error."""
    rng = np.random.default_rng(8)
    columns = [wave(rng), wave(rng)]
    y = 0.2 * columns[0] + 2.0 * columns[1] + 0.05 * rng.standard_normal(LENGTH)
    cells = Cells.of(Bands([RATE_HZ], [LENGTH], EDGES_HZ), [y[:, None]])
    cells.add([{0: [x]} for x in columns])

    class Tolerated(Machine):
        def prior(self, chosen: Sequence[Chosen], values: Array | None) -> Array:
            return np.array([0.0, 0.5**2])

    machine = Tolerated(
        cells, [Group(name, "joint", (k,), (1.0,)) for k, name in enumerate(("one", "other"))]
    )
    search = Search(machine, np.full((1, 3), 0.05**2))
    state = search.settled(search.value([Chosen(g, 1.0) for g in machine.groups], None))
    small = odds_of(search, state)[1]
    assert 0.0 < small.over_nothing < 9.5
    assert small.probability > 0.7
    assert len(without_unfounded(search, state).chosen) == 2
