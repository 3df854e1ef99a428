"""A rig that is not linear where it began is linearised again where it is."""

from dataclasses import dataclass

import numpy as np

from discrepancy import rules
from discrepancy.engine.diagnose import diagnose
from discrepancy.inference.search import search
from discrepancy.least_squares.problem import Problem
from fake_rig import CATALOGUE, FakeRig


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
    assert len(asked) == 2
    assert asked[0].free == ()
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

    def relinearised(self, found):
        self.asked.append(found.free)
        before, beside = (self.before[1:], self.beside) if not found.free else (self.before, self.beside[1:])
        missed = self.beside if found.free else self.before
        if not missed:
            return None
        other = Bending(self.present, seed=self.seed + 1, before=before, beside=beside, asked=self.asked)
        other.missed = missed[0]
        return other


def test_where_columns_bend_more_with_every_step_is_not_gone_to():
    asked = []
    searched = search(Bending({}, before=(600.0, 800.0), asked=asked, seed=1))
    assert asked == [(), ()]
    assert searched.rig.seed == 2


def test_what_bends_is_linearised_beside_the_likeliest_cause():
    asked = []
    searched = search(
        Bending({2: 25.0}, before=(600.0, 800.0), beside=(50.0, 2.0, 0.02), asked=asked, seed=1)
    )
    assert asked == [(), (), (2,), (2,), (2,), (2,)]
    assert searched.rig.seed == 5
    assert [cause.key for cause in searched.best.causes] == [CATALOGUE[2].key]


def test_beside_a_cause_too_it_ends_where_steps_do_not_help():
    searched = search(Bending({2: 25.0}, before=(600.0, 800.0), beside=(50.0, 40.0), asked=[], seed=1))
    assert searched.rig.seed == 3


def test_what_is_straight_is_not_linearised_beside_causes():
    asked = []
    search(Bending({2: 25.0}, before=(600.0, 0.2, 0.5), beside=(50.0,), asked=asked, seed=1))
    assert asked == [(), (), ()]  # nor where what it misses is less than noise


def test_what_is_not_straight_when_steps_end_is_linearised_beside_a_cause():
    asked = []
    searched = search(Bending({2: 25.0}, before=(400.0, 90.0, 30.0), beside=(50.0,), asked=asked, seed=1))
    assert asked == [(), (), (), (2,), (2,)]
    assert searched.rig.seed == 5
