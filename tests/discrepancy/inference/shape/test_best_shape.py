"""Numbers of a cause's shape: found between the grid's points, with errors as large as stated."""

from dataclasses import replace

import numpy as np
import pytest

from discrepancy import rules
from discrepancy.engine.explanation import explain
from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.inference.offer.propose import proposals
from discrepancy.inference.scan import Scanned, score_with
from discrepancy.inference.search import search
from discrepancy.inference.shape.best_shape import best_shape
from discrepancy.least_squares.fit import Fit
from discrepancy.least_squares.problem import Problem
from fake_rig import CATALOGUE, CHANNELS, RATE_HZ, ROWS, FakeRig, cause

TRUE_W, SIZE, GRID = 1.313, 1.2, 0.04
WAVE = replace(cause("wave", tolerance=0.0), shape={"w": 1.3})
PATTERN = np.array([1.0, -0.7, 0.4, 0.9])


class Wave(FakeRig):
    """Besides the others a wave of unknown frequency, of which the catalogue has a coarse grid."""

    def __post_init__(self):
        super().__post_init__()
        wave = replace(WAVE, shape={"w": TRUE_W})
        self.data = [
            (x + SIZE * self.columns(wave)[t][..., 0], *own) for t, (x, *own) in enumerate(self.data)
        ]

    def columns(self, candidate):
        if candidate.cause != "wave":
            return super().columns(candidate)
        time = np.arange(ROWS) / RATE_HZ
        waves = [np.sin(candidate.shape["w"] * time + t) for t in range(len(self.trials))]
        return [(wave[:, None] * PATTERN)[..., None] for wave in waves]

    def refinements(self, candidate, *, finer=False):
        if candidate.cause != "wave" or finer:
            return []
        return [replace(candidate, shape={"w": w}) for w in np.arange(1.1, 1.5, GRID)]

    def steps(self, candidate):
        if candidate.cause != "wave":
            return []
        w = candidate.shape["w"]
        return [(replace(candidate, shape={"w": w - 0.02}), replace(candidate, shape={"w": w + 0.02}), 0.04)]


def found_in(seed):
    explanation = explain(search(Wave({}, catalogue=(*CATALOGUE, WAVE), seed=seed)))
    (found,) = explanation.found
    return found


class Bounded(Wave):
    """Nothing has a frequency above 1.305: the likeliest is a little more than can be, as by an error of the model."""

    rigid = ("wave",)

    def possible(self, candidate, values, covariance):
        return candidate.cause != "wave" or candidate.shape["w"] <= 1.305


@pytest.mark.parametrize("start", [1.18, 1.3, 1.34])
def test_a_shape_that_can_be_is_taken_where_the_likeliest_cannot(start):
    """A payload of which the likeliest place asks for an inertia that no body has is there all the same."""
    wave = replace(WAVE, shape={"w": start})
    rig, free = (kind({}, catalogue=(*CATALOGUE, wave), seed=3) for kind in (Bounded, Wave))
    nothing = nothing_in(rig)
    item = Scanned(len(CATALOGUE), wave, 0.0)
    assert best_shape(free, nothing.problem, (), item).shape["w"] == pytest.approx(TRUE_W, abs=0.004)
    assert 1.26 < best_shape(rig, nothing.problem, (), item).shape["w"] <= 1.305
    (found,) = explain(search(rig)).found
    assert found.candidate.cause == "wave"
    assert 1.26 < found.candidate.shape["w"] <= 1.305


@pytest.mark.slow
def test_shape_is_found_between_the_grids_points_with_errors_as_stated():
    """Monte Carlo over noise, unknowns and the tolerances of all other causes."""
    runs = [found_in(seed) for seed in range(60)]
    off = np.array([[f.values[0] - SIZE, f.candidate.shape["w"] - TRUE_W] for f in runs])
    stated = np.mean([f.covariance for f in runs], axis=0)
    assert stated.shape == (2, 2)
    assert np.sqrt(stated[1, 1]) < 0.25 * GRID  # the grid alone would miss by more
    spread = off.T @ off / len(runs)
    # The square of 60 draws is known to 18 % (one standard error).
    np.testing.assert_allclose(np.diag(spread), np.diag(stated), rtol=0.5)
    squares = [x @ np.linalg.solve(f.covariance, x) for x, f in zip(off, runs, strict=True)]
    assert np.mean(squares) == pytest.approx(2.0, abs=0.8)


def test_solution_with_further_columns_is_that_of_the_extended_problem():
    rig = FakeRig({2: 25.0})
    problem = Problem.of(rig.rows(rig.candidates()), rig.candidates())
    rng = np.random.default_rng(4)
    columns = [rng.standard_normal((ROWS, CHANNELS, 2)) for _ in rig.trials]
    event = cause("event", tolerance=0.0, parameters=2)
    wider = problem.extended(event, columns)
    expected = Fit.of(wider, [2, len(wider.candidates) - 1]).part(len(wider.candidates) - 1)
    got = Fit.of(problem, [2]).solution_with(columns)
    np.testing.assert_allclose(got[0], expected[0], rtol=1e-8)
    np.testing.assert_allclose(got[1], expected[1], rtol=1e-8)


def test_column_that_tells_nothing_gets_nothing():
    """No division by nought, and the others as without it."""
    rig = FakeRig({2: 25.0})
    fit = Fit.of(Problem.of(rig.rows(rig.candidates()), rig.candidates()), [2])
    rng = np.random.default_rng(4)
    columns = [rng.standard_normal((ROWS, CHANNELS, 1)) for _ in rig.trials]
    empty = [np.concatenate([c, np.zeros_like(c)], axis=2) for c in columns]
    values, covariance = fit.solution_with(empty)
    np.testing.assert_allclose(values, [fit.solution_with(columns)[0][0], 0.0], rtol=1e-9)
    np.testing.assert_array_equal(covariance[1], 0.0)


HALF = replace(cause("half", tolerance=0.0), shape={"side": 0.0, "from": 0.0})
CREST, SIZE_HALF = 0.37, 8.0


class Half(Wave):
    """Something that acts on one side of a value alone; on the other it is nearly a straight line less that."""

    coarse = ("half",)
    low = -0.38  # where the search begins on the right side

    def __post_init__(self):
        FakeRig.__post_init__(self)
        true = replace(HALF, shape={"side": 1.0, "from": CREST})
        self.data = [
            (x + SIZE_HALF * self.columns(true)[t][..., 0], *own) for t, (x, *own) in enumerate(self.data)
        ]

    def columns(self, candidate):
        if candidate.cause != "half":
            return FakeRig.columns(self, candidate)
        time = np.arange(ROWS) / RATE_HZ
        sign, begins = 1.0 - 2.0 * candidate.shape["side"], candidate.shape["from"]
        waves = [
            np.clip(sign * (np.sin(0.9 * time + t) - begins), 0.0, None) for t in range(len(self.trials))
        ]
        return [(wave[:, None] * PATTERN)[..., None] for wave in waves]

    def refinements(self, candidate, *, finer=False):
        return [] if finer else self.further(candidate)

    def further(self, candidate):
        begun = [{"side": 0.0, "from": 0.55}, {"side": 1.0, "from": self.low}]
        return [replace(candidate, shape=shape) for shape in begun if candidate.cause == "half"]

    def steps(self, candidate):
        if candidate.cause != "half":
            return []
        ends = [candidate.shape | {"from": candidate.shape["from"] + x} for x in (-0.15, 0.15)]
        return [(*(replace(candidate, shape=shape) for shape in ends), 0.3)]


def nothing_in(rig):
    """The hypothesis that nothing is there; all that is left is noise to it."""
    return Hypothesis.of(Problem.of(rig.rows(rig.candidates()), rig.candidates()), ())


def test_shapes_far_apart_are_each_followed_to_their_best():
    """From the other side it looks better where the search begins; a single lead would stay there."""
    rig = Half({}, catalogue=(*CATALOGUE, HALF), seed=1)
    nothing = nothing_in(rig)
    wrong, right = (score_with(nothing.fit, c, rig.columns(c)) for c in rig.further(HALF))
    assert wrong > right > rules.COARSE_SHARE * wrong
    item = Scanned(len(nothing.problem.candidates) - 1, HALF, 0.0)
    best = best_shape(rig, nothing.problem, (), item)
    assert best.shape["side"] == 1.0
    assert best.shape["from"] == pytest.approx(CREST, abs=0.02)


LINE = cause("line", tolerance=0.0)


class HalfOrLine(Half):
    """Beside it something that acts on both sides alike, which explains more than it does where a scan begins."""

    low = -0.46

    def columns(self, candidate):
        if candidate.cause != "line":
            return super().columns(candidate)
        every = [
            super(HalfOrLine, self).columns(replace(HALF, shape={"side": k, "from": 0.0})) for k in (1.0, 0.0)
        ]
        return [low - high for low, high in zip(*every, strict=True)]


def test_what_is_coarse_is_sharpened_though_another_looks_likelier():
    """Rough it explains less than another does; sharp it explains all."""
    rig = HalfOrLine({}, catalogue=(*CATALOGUE, HALF, LINE), seed=1)
    nothing = nothing_in(rig)
    rough = [score_with(nothing.fit, c, rig.columns(c)) for c in (LINE, *rig.refinements(HALF))]
    assert rough[0] > max(rough[1:]) + rules.CLOSE_NATS
    best = proposals(rig, nothing).best
    assert best is not None
    assert best.causes[-1].cause == "half"
    assert best.causes[-1].shape["side"] == 1.0
    assert best.fit.part(best.free[-1])[0][0] == pytest.approx(SIZE_HALF, rel=0.1)


TWO = tuple(replace(cause("half", tolerance=0.0, robot=robot), shape=HALF.shape) for robot in (1, 2))


class TwoHalves(Half):
    """The same at two places whose traces are nearly alike; a scan begins nearer to the truth at the wrong one."""

    begun = (-0.38, -0.2)

    def columns(self, candidate):
        columns = super().columns(candidate)
        if candidate.cause != "half" or candidate.robot != 2:
            return columns
        return [c * np.array([1.0, 1.0, 1.2, 0.9])[:, None] for c in columns]

    def further(self, candidate):
        if candidate.cause != "half":
            return []
        return [replace(candidate, shape={"side": 1.0, "from": self.begun[(candidate.robot or 1) - 1]})]


def test_one_that_has_its_best_shape_is_no_measure_for_those_that_have_not():
    """Sharp, the wrong place explains far more than the right one where a scan begins; their scans are alike."""
    rig = TwoHalves({}, catalogue=(*CATALOGUE, *TWO), seed=1)
    nothing = nothing_in(rig)
    rough = [score_with(nothing.fit, c, rig.columns(c)) for one in TWO for c in rig.further(one)]
    assert rough[1] > rough[0] + rules.CLOSE_NATS
    assert rough[0] > rules.COARSE_SHARE * rough[1]
    found = proposals(rig, nothing)
    best, gained = (
        found.best,
        {
            one.candidate.robot: one.score - nothing.score
            for one in found.offers
            if one.candidate.cause == "half"
        },
    )
    assert best is not None
    assert (best.causes[-1].cause, best.causes[-1].robot) == ("half", 1)
    assert best.causes[-1].shape["from"] == pytest.approx(CREST, abs=0.02)
    assert gained[2] * rules.COARSE_SHARE > rough[0]


class Bent(Half):
    """It may grow with a power of its distance, and a search by steps alone stays where another crest is."""

    def columns(self, candidate):
        if candidate.cause != "half":
            return super().columns(candidate)
        plain = super().columns(candidate)
        return [c * (1.0 + candidate.shape.get("bend", 0.0) * np.abs(c)) for c in plain]

    def __post_init__(self):
        FakeRig.__post_init__(self)
        true = replace(HALF, shape={"side": 1.0, "from": CREST, "bend": 0.8})
        self.data = [
            (x + SIZE_HALF * self.columns(true)[t][..., 0], *own) for t, (x, *own) in enumerate(self.data)
        ]

    def grown(self, candidate):
        if candidate.cause != "half" or "bend" in candidate.shape:
            return []
        return [replace(candidate, shape={**candidate.shape, "bend": 0.0})]

    def steps(self, candidate):
        found = super().steps(candidate)
        if "bend" not in candidate.shape:
            return found
        ends = [candidate.shape | {"bend": candidate.shape["bend"] + x} for x in (-0.2, 0.2)]
        return [*found, (*(replace(candidate, shape=shape) for shape in ends), 0.4)]


def test_a_shape_grows_where_that_is_likelier():
    rig = Bent({}, catalogue=(*CATALOGUE, HALF), seed=1)
    nothing = nothing_in(rig)
    item = Scanned(len(nothing.problem.candidates) - 1, HALF, 0.0)
    best = best_shape(rig, nothing.problem, (), item)
    assert best.shape["bend"] == pytest.approx(0.8, abs=0.1)
    assert best.shape["from"] == pytest.approx(CREST, abs=0.02)


class BentOrPlain(Bent):
    """In the shape that a search begins with it cannot grow, and looks likelier than any that can and has not."""

    low = -0.25

    def columns(self, candidate):
        if "plain" not in candidate.shape:
            return super().columns(candidate)
        rng = np.random.default_rng(2)
        true = super().columns(replace(HALF, shape={"side": 1.0, "from": CREST, "bend": 0.8}))
        return [c + 0.03 * rng.standard_normal(c.shape) for c in true]

    def refinements(self, candidate, *, finer=False):
        return [] if "plain" in candidate.shape else super().refinements(candidate, finer=finer)

    def grown(self, candidate):
        return [] if "plain" in candidate.shape else super().grown(candidate)

    def steps(self, candidate):
        return [] if "plain" in candidate.shape else super().steps(candidate)


def test_what_can_grow_does_so_though_another_shape_is_likelier_before():
    """As a strap that stiffens, which looks more like a spring than like a cable of one stiffness."""
    plain = replace(HALF, shape={"plain": 0.0})
    rig = BentOrPlain({}, catalogue=(*CATALOGUE, plain), seed=1)
    nothing = nothing_in(rig)
    straight = replace(HALF, shape={"side": 1.0, "from": 0.227})  # the best without
    bent = replace(HALF, shape={**straight.shape, "bend": 0.8})
    likelier = [score_with(nothing.fit, c, rig.columns(c)) for c in (straight, plain, bent)]
    assert likelier == sorted(likelier)
    best = best_shape(rig, nothing.problem, (), Scanned(len(nothing.problem.candidates) - 1, plain, 0.0))
    assert best.shape["bend"] == pytest.approx(0.8, abs=0.1)


class Apart(Half):
    """Steps from where a search begins lead away; another start of the same kind is offered at the end of the lead."""

    low = -0.41

    def refinements(self, candidate, *, finer=False):
        if candidate.cause == "half" and finer:
            return [replace(candidate, shape=candidate.shape | {"from": 0.1})]
        return super().refinements(candidate, finer=finer)

    def steps(self, candidate):
        # Below it nothing leads up: as of a cable that is never slack.
        return [] if candidate.shape.get("from", 0.0) < -0.4 else super().steps(candidate)


def test_a_lead_is_followed_from_elsewhere_too():
    rig = Apart({}, catalogue=(*CATALOGUE, HALF), seed=1)
    nothing = nothing_in(rig)
    item = Scanned(len(nothing.problem.candidates) - 1, HALF, 0.0)
    best = best_shape(rig, nothing.problem, (), item)
    assert best.shape["side"] == 1.0
    assert best.shape["from"] == pytest.approx(CREST, abs=0.02)


THREE = tuple(replace(cause("drift", robot), shape={"from": 0.0}) for robot in (1, 2, 3))


class Drift(FakeRig):
    """A kind of three places of which only differences show, each with a shape that it may have."""

    def __post_init__(self):
        super().__post_init__()
        late = replace(THREE[2], shape={"from": 0.6})  # something small that looks like it
        fault = [60.0 * c + 3.0 * d for c, d in zip(self.columns(THREE[2]), self.columns(late), strict=True)]
        self.data = [(x + fault[t][..., 0], *own) for t, (x, *own) in enumerate(self.data)]

    def columns(self, candidate):
        if candidate.cause != "drift":
            return super().columns(candidate)
        time = np.arange(ROWS) / RATE_HZ
        ramp = np.clip(time / time[-1] - candidate.shape["from"], 0.0, None)
        apart = PATTERN if candidate.robot == 1 else PATTERN[::-1]
        along = -(PATTERN + PATTERN[::-1]) if candidate.robot == 3 else apart
        return [0.3 * (ramp[:, None] * along)[..., None] for _ in self.trials]

    def refinements(self, candidate, *, finer=False):
        if candidate.cause != "drift" or finer:
            return []
        shapes = ({"from": x} for x in (0.0, 0.3, 0.6, 0.9))
        return [replace(candidate, shape=s) for s in shapes if s != candidate.shape]


def test_a_fault_that_its_kind_would_explain_keeps_its_shape():
    """Where the others of its kind scatter to make up for it, no shape of it explains a thing."""
    rig = Drift({}, catalogue=(*CATALOGUE, *THREE), seed=2)
    nothing = nothing_in(rig)
    index = [c.key for c in nothing.problem.candidates].index(THREE[2].key)
    assert nothing.problem.spread[nothing.problem.columns_of(index)][0] > 10.0
    best = proposals(rig, nothing).best
    assert best is not None
    assert best.causes[-1].key == THREE[2].key
    assert best.causes[-1].shape == {"from": 0.0}
    assert best.fit.part(best.free[-1])[0][0] == pytest.approx(60.0, abs=5.0)
