"""Exact residuals: a cause whose effect is not straight, on a rig of pure numbers."""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.optimize import brentq

from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.inference.refit import exact
from discrepancy.least_squares.problem import Problem
from fake_rig import CATALOGUE, FakeRig


def bent(value, by):
    return value + by * value**2


@dataclass
class Bent(FakeRig):
    """A value acts as ``bent`` has it; its slope at nought is that of the columns."""

    by: float = 0.0

    def residual(self, shared, local, active):
        return super().residual(shared, local, [(c, bent(v, self.by)) for c, v in active])


def hypotheses(rig, free):
    problem = Problem.of(rig.rows(rig.candidates()), rig.candidates())
    return Hypothesis.of(problem, free), Hypothesis.of(problem, [])


@pytest.mark.parametrize("by", [0.003, -0.003])
def test_value_is_that_whose_effect_the_data_hold(by):
    """The effect is what a straight fit finds; the value follows by solving for it."""
    rig = Bent({2: 25.0}, by=by)
    linear, nothing = hypotheses(rig, [2])
    effect = linear.fit.part(2)[0][0]
    expected = brentq(lambda v: bent(v, by) - effect, 0.0, 60.0)
    assert abs(expected - effect) > 1.0
    fit = exact(rig, linear, nothing).fit
    assert fit.part(2)[0][0] == pytest.approx(expected, abs=0.25 * np.sqrt(fit.part(2)[1][0, 0]))
    # Unknowns are what they were: the rest of the data is the same.
    np.testing.assert_allclose(fit.shared, linear.fit.shared, atol=2e-2)
    for t in linear.problem.trials:
        np.testing.assert_allclose(fit.local(t), linear.fit.local(t), atol=2e-2)
        np.testing.assert_allclose(fit.remaining(t), linear.fit.remaining(t), atol=0.1)


def test_straight_effects_stay():
    rig = Bent({2: 25.0, 5: [9.0, -7.0]})
    linear, nothing = hypotheses(rig, [2, 5])
    again = exact(rig, linear, nothing)
    np.testing.assert_allclose(again.fit.solution, linear.fit.solution, rtol=1e-4, atol=1e-4)
    assert again.score == pytest.approx(linear.score, abs=0.1)


def test_step_that_diverges_is_not_taken():
    """An effect that turns round: the straight answer is the better one."""
    rig = Bent({2: 25.0}, by=-0.5)
    linear, nothing = hypotheses(rig, [2])
    assert exact(rig, linear, nothing) is linear


def test_what_is_allowed_stays_allowed():
    rig = Bent({2: 25.0}, by=0.003)
    linear, nothing = hypotheses(rig, [2])
    allowed = Hypothesis(linear.learnt, {2: 7.0})
    assert exact(rig, allowed, nothing).allowed == {2: 7.0}
    assert allowed.score == pytest.approx(linear.score - 7.0)
    assert (
        allowed.without(2).allowed == {}
    )  # found again, it would be charged for what it had been beside once

    assert CATALOGUE[2] in linear.causes


@pytest.mark.parametrize("beside", [False, True])
def test_unknowns_are_moved_from_where_they_are_without_causes_or_from_where_all_is_linear_beside_some(
    beside, monkeypatch
):
    rig = FakeRig({2: 25.0})
    rig.beside = beside
    linear, nothing = hypotheses(rig, [2])
    asked, residual = [], rig.residual
    monkeypatch.setattr(rig, "residual", lambda *args: asked.append(args) or residual(*args), raising=True)
    exact(rig, linear, nothing)
    shared, local, _ = asked[0]
    start = 0.0 * nothing.fit.shared if beside else nothing.fit.shared
    np.testing.assert_allclose(-shared, linear.fit.shared - start, atol=1e-9)
    assert np.abs(nothing.fit.shared).max() > 1.0  # and so it matters
    for t, x in enumerate(local):
        there = 0.0 * nothing.fit.local(t) if beside else nothing.fit.local(t)
        np.testing.assert_allclose(-x, linear.fit.local(t) - there, atol=1e-9)


class Told(Bent):
    """Cause 2 alone bends, and the rig says how."""

    def residual(self, shared, local, active):
        bends = [(c, bent(v, self.by) if c.key == CATALOGUE[2].key else v) for c, v in active]
        return FakeRig.residual(self, shared, local, bends)

    def bent(self, candidate, values):
        if candidate.key != CATALOGUE[2].key:
            return None
        columns = self.columns(candidate)
        return [c * (1.0 + 2.0 * self.by * values) for c in columns], [
            c * (1.0 + self.by * values) for c in columns
        ]


@pytest.mark.parametrize("by", [0.02, -0.009])
def test_what_bends_strongly_is_found_where_the_rig_says_how(by):
    rig = Told({2: 25.0, 4: 11.0}, by=by)
    linear, nothing = hypotheses(rig, [2, 4])
    effect = linear.fit.part(2)[0][0]
    expected = brentq(lambda v: bent(v, by) - effect, 0.0, 0.5 / abs(by) if by < 0 else 60.0)
    found = exact(rig, linear, nothing)
    assert found.fit.part(2)[0][0] == pytest.approx(expected, rel=2e-3)
    assert found.fit.part(4)[0][0] == pytest.approx(linear.fit.part(4)[0][0], abs=0.05)
    # Without the cause, the model sees what was measured: columns go from nought to where it is.
    last = np.zeros(found.problem.width)
    last[-1] = 1.0
    for t in found.problem.trials:
        np.testing.assert_allclose(
            found.problem.raw_times(t, last), linear.problem.raw_times(t, last), atol=2e-3
        )
        np.testing.assert_allclose(found.fit.remaining(t), linear.fit.remaining(t), atol=0.05)


@dataclass
class Flattered(Told):
    """Straight columns of cause 2 hold some of what is left in the data, as those made of adjusted signals do."""

    flatter: float = 0.0

    def columns(self, candidate):
        plain = super().columns(candidate)
        if candidate.key != CATALOGUE[2].key or not self.flatter:
            return plain
        left = np.random.default_rng(99)
        return [c + self.flatter * left.standard_normal(c.shape) for c in plain]

    def residual(self, shared, local, active):
        flatter, self.flatter = self.flatter, 0.0
        out = super().residual(shared, local, active)
        self.flatter = flatter
        return out

    def bent(self, candidate, values):
        flatter, self.flatter = self.flatter, 0.0
        out = super().bent(candidate, values)
        self.flatter = flatter
        return out


@pytest.mark.parametrize(("flatter", "taken"), [(0.02, True), (0.1, False)])
def test_the_straight_answer_of_what_bends_may_flatter_it_a_little(flatter, taken):
    rig = Flattered({2: 25.0}, by=0.004)
    left = np.random.default_rng(99)
    for t, (x, local, shared) in enumerate(rig.data):
        noise = left.standard_normal((*x.shape, 1))[..., 0]
        rig.data[t] = x + 25.0 * flatter * noise, local, shared
    rig.flatter = flatter
    linear, nothing = hypotheses(rig, [2])
    found = exact(rig, linear, nothing)
    assert (found is not linear) == taken


@dataclass
class Grown(FakeRig):
    """What cause 4 does grows with cause 2, as a centre of mass counts for more in a heavier link."""

    curved = True
    by: float = 0.0

    def residual(self, shared, local, active):
        values = {c.key: v for c, v in active}
        more = 1.0 + self.by * values.get(CATALOGUE[2].key, np.zeros(1))[0]
        grown = [(c, v * more if c.key == CATALOGUE[4].key else v) for c, v in active]
        return super().residual(shared, local, grown)


def test_steps_are_shortened_where_slopes_have_grown():
    """Two and a half times the slope: whole steps go to the other side, one and a half times as far."""
    rig = Grown({2: 30.0, 4: 2.5 * 8.0}, by=0.05)
    linear, nothing = hypotheses(rig, [2])
    found = exact(rig, linear, nothing)
    assert found is not linear
    heavy = found.fit.part(2)[0][0]
    expected = linear.fit.part(4)[0][0] / (1.0 + rig.by * heavy)
    assert found.fit.part(4)[0][0] == pytest.approx(expected, abs=0.05)
    for t in linear.problem.trials:
        np.testing.assert_allclose(found.fit.remaining(t), linear.fit.remaining(t), atol=0.3)


@dataclass
class Overshot(FakeRig):
    """Cause 2 also leaves a trace of its value's square, which looks like more of it in part."""

    by: float = 0.02
    alike: float = 1.2

    def __post_init__(self):
        super().__post_init__()
        rng = np.random.default_rng(7)
        own = self.columns_of[CATALOGUE[2].key]
        self.square = [
            self.by * (self.alike * column + 0.3 * rng.standard_normal(column.shape))[..., 0]
            for column in own
        ]
        value = self.present[2]
        self.data = [(x + value**2 * s, *rest) for (x, *rest), s in zip(self.data, self.square, strict=True)]

    def residual(self, shared, local, active):
        (value,) = (v[0] for c, v in active if c.key == CATALOGUE[2].key)
        out = super().residual(shared, local, active)
        return [x - value**2 * s for x, s in zip(out, self.square, strict=True)]


def test_a_step_that_loses_too_much_is_shortened():
    """Straight, 40 where 25 is there, which leaves more than nothing of the square; half of the way is near."""
    rig = Overshot({2: 25.0})
    linear, nothing = hypotheses(rig, [2])
    assert linear.fit.part(2)[0][0] == pytest.approx(40.0, abs=1.5)
    asked = []
    residual = rig.residual
    rig.residual = lambda *args: asked.append(args[2][0][1][0]) or residual(*args)
    found = exact(rig, linear, nothing)
    assert asked[1] == pytest.approx(0.5 * asked[0])
    assert found.fit.part(2)[0][0] == pytest.approx(25.0, abs=1.0)
    assert found.score > linear.score + 100.0
