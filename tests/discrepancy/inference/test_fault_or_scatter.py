"""A fault of one place, or a kind that scatters: which, where other kinds leave the same trace."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from discrepancy import rules
from discrepancy.engine.diagnose import diagnose
from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.inference.offer.propose import proposals
from discrepancy.inference.search import search
from discrepancy.least_squares.problem import Problem
from fake_rig import CATALOGUE, NINE, FakeRig, cause, found_in, names


def test_a_kind_that_scatters_is_no_fault_of_any():
    """Nine places with twenty times their tolerance."""
    rng = np.random.default_rng(6)
    values = 20.0 * rng.standard_normal(9)
    diagnosis = diagnose(FakeRig(dict(enumerate(values)), catalogue=(*NINE, *CATALOGUE)), closed_loop=False)
    assert diagnosis.causes == ()
    (scatter,) = diagnosis.explanation.scatter
    assert scatter.candidate.cause == "many"
    assert scatter.places == 9
    expected = np.sqrt((np.sum(values**2) + rules.SPREAD_NUMBERS) / (9 + rules.SPREAD_NUMBERS))
    assert scatter.factor == pytest.approx(expected, rel=0.1)  # each is a tolerance off besides
    assert scatter.nats > 20.0
    assert diagnosis.verdict == "miscalibrated"


def test_one_fault_in_a_kind_of_nine_is_a_fault():
    explanation = found_in(FakeRig({4: 30.0}, catalogue=(*NINE, *CATALOGUE)))
    (found,) = explanation.found
    assert found.candidate.key == NINE[4].key
    assert found.values[0] == pytest.approx(30.0, abs=3.0)
    assert explanation.scatter == ()
    beside = explanation.problem.spread[explanation.problem.columns_of(0)][0]
    assert beside < 2.0  # what the others scatter once it is out


def test_a_fault_among_what_scatters_is_both():
    rng = np.random.default_rng(6)
    values = dict(enumerate(8.0 * rng.standard_normal(9))) | {7: 300.0}
    explanation = found_in(FakeRig(values, catalogue=(*NINE, *CATALOGUE)))
    assert [f.candidate.key for f in explanation.found] == [NINE[7].key]
    (scatter,) = explanation.scatter
    assert 3.0 < scatter.factor < 16.0


class HalfSeenRig(FakeRig):
    """The last cause has a tolerance; in the catalogue's shape half of its trace is that of something else."""

    def columns(self, candidate):
        columns = super().columns(candidate)
        if candidate.cause != "bent" or candidate.shape:
            return columns
        return [c + np.roll(c, 31, axis=0) for c in columns]

    def refinements(self, candidate, *, finer=False):
        return [] if finer or candidate.cause != "bent" else [replace(candidate, shape={"right": 1.0})]


def test_the_likeliest_is_in_its_best_shape_however_far_others_scatter():
    """Held within their tolerance, nine places that scatter by 100 of them are worth thousands of nats each."""
    rng = np.random.default_rng(6)
    values = dict(enumerate(100.0 * rng.standard_normal(9))) | {9: 30.0}
    rig = HalfSeenRig(values, catalogue=(*NINE, cause("bent", tolerance=1.0)), seed=5)
    found = found_in(rig).found
    assert names(found) == ["bent"]
    assert found[0].candidate.shape == {"right": 1.0}
    assert found[0].values[0] == pytest.approx(30.0, abs=3.0)


def test_a_fault_of_one_of_two_kinds_with_one_trace_is_seen_in_both():
    """Either could be it; while the one is looked at, the other may not take it for a scatter of its own."""
    catalogue = tuple(cause(kind, robot) for kind in ("lag", "late") for robot in (1, 2, 3))
    rig = FakeRig({4: 200.0}, catalogue=catalogue, twins={k + 3: (k, 0.0) for k in range(3)})
    nothing = Hypothesis.of(Problem.of(rig.rows(catalogue), catalogue), ())
    wide = nothing.problem.spread[[0, 3]]
    assert min(wide) < 1.5 < 3.0 < max(wide)
    seen = {one.candidate.key: one.score for one in proposals(rig, nothing, events=False).offers}
    assert seen["lag", 2, None] == pytest.approx(seen["late", 2, None], abs=0.5)
    assert seen["late", 2, None] > nothing.score


@dataclass
class BentRig(FakeRig):
    """One cause leaves something else, in the square of its size, where it is exact."""

    curls: str = ""

    def residual(self, shared, local, active):
        out = super().residual(shared, local, active)
        rng = np.random.default_rng(99)
        for x in out:
            pattern = rng.standard_normal(x.shape)
            x += sum(values[0] ** 2 for c, values in active if c.cause == self.curls) * 2e-4 * pattern
        return out


@pytest.mark.parametrize(("wrong", "right"), [("cause 2", "cause 4"), ("cause 4", "cause 2")])
def test_what_straight_columns_do_not_part_is_parted_where_it_is_exact(wrong, right):
    rig = BentRig({2: 25.0}, twins={4: (2, 0.0)}, curls=wrong)
    assert names(found_in(rig).found) == [right]


SCATTERED = tuple(cause("clock", robot) for robot in (1, 2, 3)) + CATALOGUE


@dataclass
class ShiftedRig(FakeRig):
    """Moving by what is there makes every residual a little louder, whatever is there."""

    louder: float = 0.0

    def residual(self, shared, local, active):
        rng = np.random.default_rng(98)
        out = super().residual(shared, local, active)
        return [x + self.louder * (len(active) > 0) * rng.standard_normal(x.shape) for x in out]


def test_a_fault_and_a_scatter_count_at_the_same_residual():
    """One of three places off looks like a scatter; what exact residuals cost both is no evidence for the scatter."""
    rig = ShiftedRig({0: 10.0}, catalogue=SCATTERED, louder=0.15)
    base = search(rig).nothing
    assert base.problem.spread[base.problem.columns_of(0)][0] > rules.SCATTER_FACTOR
    (found,) = found_in(rig).found
    assert (found.candidate.cause, found.candidate.robot) == ("clock", 1)
    # By another residual than the scatter's it would have lost more than it gains.
    searched = search(rig)
    assert searched.best.score < searched.nothing.score


def test_they_do_where_the_others_scatter_a_little_still():
    """As far as a half beyond their tolerance counts as a scatter; no edge in the comparison may be there."""
    rig = ShiftedRig({0: 20.0, 1: 3.7, 2: -3.7}, catalogue=SCATTERED, louder=0.15)
    searched = search(rig)
    assert [c.cause for c in searched.best.causes] == ["clock"]
    beside = searched.best.problem.spread[searched.best.problem.columns_of(1)][0]
    assert rules.HELD_FACTOR < beside < rules.SCATTER_FACTOR
    assert searched.best.score < searched.nothing.score


LAGS = tuple(cause("lag", robot) for robot in (1, 2, 3))


def test_another_kind_that_hardly_scatters_does_not_hide_a_fault():
    """Three places that happen to be 1.6 tolerances off are no sign of a team that is off everywhere."""
    rig = FakeRig({0: 17.0, 3: 2.2, 4: -2.2, 5: 2.2}, catalogue=(*SCATTERED[:3], *LAGS, *CATALOGUE))
    problem = search(rig).nothing.problem
    assert problem.spread[problem.columns_of(0)][0] > rules.SCATTER_FACTOR
    assert rules.HELD_FACTOR < problem.spread[problem.columns_of(3)][0] < rules.SCATTER_FACTOR
    (found,) = found_in(rig).found
    assert (found.candidate.cause, found.candidate.robot) == ("clock", 1)
    assert found.over_nothing < rules.NAMED_NATS


def test_two_kinds_that_scatter_hide_one_that_hardly_stands_out():
    rig = FakeRig({0: 17.0, 3: 8.0, 4: -8.0, 5: 8.0}, catalogue=(*SCATTERED[:3], *LAGS, *CATALOGUE))
    explanation = found_in(rig)
    assert explanation.found == ()
    assert {scatter.candidate.cause for scatter in explanation.scatter} == {"clock", "lag"}


@pytest.mark.parametrize(("bent", "wanted"), [("clock", "lag"), ("lag", "clock")])
def test_a_scatter_of_another_kind_with_the_same_trace_does_not_hide_a_fault(bent, wanted):
    """Which of the two kinds takes the scatter is by chance; which place is at fault, exact residuals tell."""
    twins = {3: (0, 0.0), 4: (1, 0.0), 5: (2, 0.0)}
    present = {3 if wanted == "lag" else 0: 17.0}
    rig = BentRig(present, catalogue=(*SCATTERED[:3], *LAGS, *CATALOGUE), twins=twins, curls=bent)
    (found,) = found_in(rig).found
    assert (found.candidate.cause, found.candidate.robot) == (wanted, 1)
