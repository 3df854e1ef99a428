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

    def relinearised(self, nothing):
        self.asked.append(nothing)
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
