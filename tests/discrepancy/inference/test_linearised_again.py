"""A rig that is not linear where it began is linearised again where it is."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from discrepancy import rules
from discrepancy.engine.diagnose import diagnose
from discrepancy.inference.base import based
from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.inference.search import search
from discrepancy.inference.straightened import Beside, straightened
from discrepancy.team.linear.patches import Patches
from discrepancy.least_squares.problem import Problem
from fake_rig import CATALOGUE, CHANNELS, ROWS, FakeRig


@dataclass
class Moved(FakeRig):
    """A rig that is to be linear elsewhere, so many times; where it is then its residual is smaller."""

    left: int = 1
    asked: list = None

    def relinearised(self, found):
        self.asked.append(found)
        if not self.left:
            return None
        other = Moved(self.present, seed=self.seed + 1, left=self.left - 1, asked=self.asked)
        return other


def test_search_is_of_the_rig_linearised_again():
    asked = []
    searched = search(Moved({2: 25.0}, left=1, asked=asked, seed=1))
    assert [found.free for found in asked] == [(), (), (2,)]
    assert searched.rig.seed == 2
    own = Problem.of(searched.rig.rows(CATALOGUE), CATALOGUE)
    np.testing.assert_array_equal(
        searched.nothing.problem.raw_columns(0, slice(None)), own.raw_columns(0, slice(None))
    )
    assert diagnose(Moved({2: 25.0}, left=1, asked=[], seed=1), closed_loop=False).rig.seed == 2


def test_linearising_again_ends():
    asked = []
    searched = search(Moved({}, left=100, asked=asked, seed=1))
    assert len(asked) == rules.BASE_ROUNDS - 1
    own = Problem.of(searched.rig.rows(CATALOGUE), CATALOGUE)
    np.testing.assert_array_equal(
        searched.nothing.problem.raw_columns(0, slice(None)), own.raw_columns(0, slice(None))
    )


@dataclass
class Bending(FakeRig):
    """A rig that is never linear enough: what it missed, before any cause is known and beside one, step by step."""

    before: tuple = ()
    beside: tuple = ()
    asked: list = None
    moves: int = 0

    def relinearised(self, found):
        self.asked.append(found.free)
        before, beside = (self.before[1:], self.beside) if not found.free else (self.before, self.beside[1:])
        missed = self.beside if found.free else self.before
        if not missed:
            return None
        other = replace(self, before=before, beside=beside, moves=self.moves + 1)
        other.missed = missed[0]
        return other


def test_where_columns_bend_more_with_every_step_is_not_gone_to():
    asked = []
    searched = search(Bending({}, before=(600.0, 800.0), asked=asked, seed=1))
    assert asked == [(), ()]
    assert searched.rig.moves == 1


def test_what_bends_is_linearised_beside_the_likeliest_cause():
    asked = []
    searched = search(
        Bending({2: 25.0}, before=(600.0, 800.0), beside=(50.0, 2.0, 0.02), asked=asked, seed=1)
    )
    assert asked == [(), (), (2,), (2,), (2,), (2,), (2,)]  # once more where the search has begun
    assert searched.rig.moves == 4
    assert [cause.key for cause in searched.best.causes] == [CATALOGUE[2].key]


def test_beside_a_cause_too_it_ends_where_steps_do_not_help():
    searched = search(Bending({2: 25.0}, before=(600.0, 800.0), beside=(50.0, 40.0, 30.0), asked=[], seed=1))
    assert searched.rig.moves == 3  # 50 before the search and 40 in it


def test_beside_every_cause_that_pays_it_is_asked_whether_columns_reach():
    asked = []
    searched = search(Bending({2: 25.0, 3: 25.0}, before=(0.2,), beside=(), asked=asked, seed=1))
    assert asked[:2] == [(), ()]
    assert [sorted(free) for free in asked[2:]] in ([[2], [2, 3]], [[3], [2, 3]])
    assert searched.rig.moves == 1
    search(Bending({}, before=(), beside=(50.0,), asked=(none := []), seed=1))
    assert none == [()]  # without one it is not


def test_without_a_cause_what_is_straight_is_not_linearised_beside_any():
    asked = []
    search(Bending({}, before=(600.0, 0.2, 0.5), beside=(50.0,), asked=asked, seed=1))
    assert asked == [(), (), ()]  # nor where what it misses is less than noise


def test_what_is_not_straight_when_steps_end_is_linearised_beside_a_cause():
    asked = []
    searched = search(Bending({2: 25.0}, before=(400.0, 90.0, 30.0), beside=(50.0,), asked=asked, seed=1))
    assert asked == [(), (), (), (2,), (2,), (2,)]  # once more where the search has begun
    assert searched.rig.moves == 4


def test_linearising_beside_a_cause_ends():
    """A rig that always goes on, and does not say what its columns miss."""
    asked = []
    search(Bending({2: 25.0}, before=(), beside=(0.0,) * 100, asked=asked, seed=1))
    assert asked == [(), *[(2,)] * rules.BASE_ROUNDS]


@dataclass
class Turned(FakeRig):
    """A rig whose columns and data are others where it is linearised again, once, beside a cause."""

    there: int = 0
    is_moved: bool = False
    is_louder: bool = False

    def relinearised(self, found):
        if self.is_moved or not found.free:
            return None
        other = Turned(self.present, seed=self.there, burst=self.burst, is_moved=True)
        other.missed, other.rewhitened = 5.0, self.is_louder
        return other

    def unknowns(self, candidate):
        if candidate.cause != "cause 2":
            return super().unknowns(candidate)
        rng, dense = np.random.default_rng(self.seed), np.zeros((len(self.trials), ROWS, CHANNELS, 1))
        dense[:, :40] = rng.standard_normal((len(self.trials), 40, CHANNELS, 1))
        return [Patches.of(columns) for columns in dense]


def test_causes_are_carried_over_with_their_intervals_and_what_they_leave_open():
    rig = Turned({2: 25.0}, burst=(1, 6.0, 3), seed=4, there=6)
    _, nothing, _ = based(rig, rules.PRIOR_ODDS, str)
    push, problem = rig.transients([])[0], nothing.problem
    looked_at = replace(push, transient=replace(push.transient, trial=2))  # and is not there
    problem = problem.extended(looked_at, rig.columns(looked_at))
    problem = problem.extended(push, rig.columns(push))
    problem = problem.with_unknowns(CATALOGUE[2].key, rig.unknowns(CATALOGUE[2]), 2.0)
    index = len(problem.candidates) - 1
    found = Hypothesis.of(problem, (2, index), {2: 1.5, index: 0.5})
    step = straightened(Beside.of(rig, nothing, found), str)
    moved, bare, there = step.rig, step.nothing, step.found
    assert moved.is_moved
    own = Problem.of(moved.rows([*CATALOGUE, push]), [*CATALOGUE, push])
    own = own.with_unknowns(CATALOGUE[2].key, moved.unknowns(CATALOGUE[2]), 2.0)
    assert there.free == (2, len(CATALOGUE))
    assert there.allowed == {2: 1.5, len(CATALOGUE): 0.5}
    assert there.score == pytest.approx(Hypothesis.of(own, there.free, there.allowed).score, abs=0.1)
    assert bare.score == pytest.approx(Hypothesis.of(Problem.of(moved.rows(CATALOGUE), CATALOGUE), ()).score)
    assert there.fit.part(2)[0][0] == pytest.approx(25.0, abs=3.0)


def test_where_it_is_less_likely_it_is_not_linearised():
    """Columns may flatter what is there, for something else that is missing. Where noise is another nothing tells."""
    likelier = set()
    for there in range(10):
        rig = Turned({2: 25.0}, seed=4, there=there)
        _, nothing, _ = based(rig, rules.PRIOR_ODDS, str)
        found = Hypothesis.of(nothing.problem, (2,))
        other = replace(rig, seed=there)
        expected = Hypothesis.of(Problem.of(other.rows(CATALOGUE), CATALOGUE), (2,)).score
        if expected < found.score - 1.0:
            assert straightened(Beside.of(rig, nothing, found), str) is None
            likelier.add(False)
            louder = replace(rig, is_louder=True)
            assert straightened(Beside.of(louder, nothing, found), str) is not None
        elif expected > found.score + 1.0:
            likelier.add(True)
            assert straightened(Beside.of(rig, nothing, found), str).found.score == pytest.approx(
                expected, abs=0.1
            )
    assert likelier == {False, True}
