"""Which of two causes is there: by the data, and beside what other forms of the rest could do."""

import numpy as np
import pytest

from discrepancy.inference.exchange import settled
from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.inference.other_forms import beside_other_forms
from discrepancy.least_squares.problem import Problem
from fake_rig import CATALOGUE, FakeRig, cause


class Formed(FakeRig):
    """What else is there may leave nearly all that cause 2 does, by the forms that it may have."""

    def other_forms(self, candidate, values, there, rival=None):
        if candidate.cause != "cause 2":
            return []
        rng = np.random.default_rng(0)
        return [20.0 * (c + 0.1 * rng.standard_normal(c.shape)) for c in self.columns(candidate)]


def test_which_of_two_is_there_is_asked_of_the_data_alone():
    """What one was charged when it was added, for what is known of another since, is no reason for the other."""
    none = [cause(c.cause, tolerance=0.0) if c.cause in ("cause 2", "cause 4") else c for c in CATALOGUE]
    rig = Formed({2: 60.0, 5: [90.0, -80.0]}, twins={4: (2, 0.2)}, catalogue=tuple(none))
    problem = Problem.of(rig.rows(rig.candidates()), rig.candidates())
    there = Hypothesis.of(problem, (5, 2), {2: 40000.0})
    instead = Hypothesis.of(problem, (5, 4))
    assert there.score < instead.score < there.uncharged
    found, rivals = settled(rig, there, Hypothesis.of(problem, ()))
    assert set(found.free) == {5, 2}
    gap = next(r.gap for r in rivals[2] if r.candidate is not None and r.candidate.cause == "cause 4")
    assert gap == pytest.approx(found.uncharged - instead.uncharged, rel=0.02)


class BothFormed(Formed):
    """Half of what cause 4 does may be left so, too."""

    def other_forms(self, candidate, values, there, rival=None):
        if candidate.cause != "cause 4":
            return super().other_forms(candidate, values, there, rival)
        rng = np.random.default_rng(1)
        return [20.0 * (c + rng.standard_normal(c.shape) * c.std()) for c in self.columns(candidate)]


def test_an_exchange_does_not_end_a_search():
    """What fits better and is charged for it is no gain, and a search for gains ended with it: both have to say so."""
    none = [cause(c.cause, tolerance=0.0) if c.cause in ("cause 2", "cause 4") else c for c in CATALOGUE]
    rig = BothFormed({4: 60.0, 5: [90.0, -80.0]}, twins={4: (2, 0.2)}, catalogue=tuple(none))
    problem = Problem.of(rig.rows(rig.candidates()), rig.candidates())
    there, instead = Hypothesis.of(problem, (5, 2)), Hypothesis.of(problem, (5, 4))
    charged = beside_other_forms(rig, instead, 4, instead.without(4))
    judged = beside_other_forms(rig, there, 2, there.without(2))
    assert judged.score < charged.score < there.score < instead.score
    found, rivals = settled(rig, there, Hypothesis.of(problem, ()))
    assert found.score >= there.score
    assert set(found.free) == {5, 2}
    gap = next(r.gap for r in rivals[2] if r.candidate is not None and r.candidate.cause == "cause 4")
    assert gap == 0.0  # the data prefer it, what it is charged for does not: as likely as not


class Unlike(Formed):
    """What matters for cause 2 does not for cause 4."""

    def other_forms(self, candidate, values, there, rival=None):
        if rival is not None and rival.cause == "cause 4":
            return []
        return super().other_forms(candidate, values, there, rival)

    def charged_alike(self, one, other):
        return (one.cause == "cause 2") == (other.cause == "cause 2")


@pytest.mark.parametrize("apart", [0.005, 0.02])
def test_what_one_of_two_alone_is_charged_for_does_not_part_them(apart):
    """Friction is not charged for other friction, an offset is: as likely by the data, they share the probability."""
    none = [cause(c.cause, tolerance=0.0) if c.cause in ("cause 2", "cause 4") else c for c in CATALOGUE]
    gaps = []
    for kind in (Formed, Unlike):
        rig = kind({4: 60.0, 5: [90.0, -80.0]}, twins={4: (2, apart)}, catalogue=tuple(none))
        problem = Problem.of(rig.rows(rig.candidates()), rig.candidates())
        there, instead = Hypothesis.of(problem, (5, 4)), Hypothesis.of(problem, (5, 2))
        found, rivals = settled(rig, there, Hypothesis.of(problem, ()))
        assert set(found.free) == {5, 4}
        gaps.append(
            next(r.gap for r in rivals[4] if r.candidate is not None and r.candidate.cause == "cause 2")
        )
        data = max(there.uncharged - instead.uncharged, 0.0)
    charged, alike = gaps
    assert charged > data + 50.0
    assert alike == pytest.approx(data, abs=0.1 + 0.02 * data)


def test_what_was_charged_for_forms_that_matter_no_more_is_no_charge():
    """The others it stood beside are gone; but what it is charged for else, such as what it leaves open, stays."""
    for kind, kept in ((Formed, {}), (FakeRig, {4: 100.0})):
        rig = kind({4: 60.0, 5: [90.0, -80.0]}, catalogue=CATALOGUE)
        problem = Problem.of(rig.rows(rig.candidates()), rig.candidates())
        there = Hypothesis.of(problem, (5, 4), {4: 100.0})
        assert beside_other_forms(rig, there, 4, there.without(4)).allowed == kept
