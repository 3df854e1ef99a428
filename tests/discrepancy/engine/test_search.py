"""Search and diagnosis on a rig of pure numbers, where the truth is known."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from discrepancy import rules
from discrepancy.candidate import Transient
from discrepancy.engine.diagnose import diagnose
from discrepancy.engine.explanation import explain
from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.inference.propose import proposals
from discrepancy.inference.remainder import unlisted_nats
from discrepancy.inference.scan import score_of
from discrepancy.inference.search import search
from discrepancy.least_squares.fit import Fit
from discrepancy.least_squares.patches import Patches
from discrepancy.least_squares.problem import Problem
from discrepancy.result.evidence_list import evidence_list
from discrepancy.rules import CLEAN_CHI2_PER_N
from fake_rig import CATALOGUE, CHANNELS, NINE, RATE_HZ, ROWS, TWINS, FakeRig, cause, names


def found_in(rig, **options):
    return explain(search(rig, **options))


def with_push(rig, values, which=0):
    """The rig with one of its events in place."""
    push = rig.transients([])[which]
    t = push.transient.trial
    x, local, shared = rig.data[t]
    rig.data[t] = x + rig.columns(push)[t] @ np.array(values), local, shared
    return rig


@pytest.mark.parametrize("seed", range(5))
def test_clean_data_have_no_cause(seed):
    rig = FakeRig({}, seed=seed)
    diagnosis = diagnose(rig, closed_loop=False)
    explanation = diagnosis.explanation
    assert names(explanation.found) == names(explanation.suspected) == []
    assert explanation.scatter == ()
    assert explanation.samples == 4 * 120 * 4
    assert explanation.after == explanation.before < CLEAN_CHI2_PER_N * explanation.samples
    assert diagnosis.verdict == "consistent"
    assert diagnosis.not_simulated
    assert diagnosis.notes == ()


@pytest.mark.parametrize("seed", [1, 2])
def test_one_cause_is_found_with_its_value(seed):
    rig = FakeRig({2: 25.0}, seed=seed)
    off = np.random.default_rng(seed).standard_normal(10)  # as the rig draws them; the sixth has two numbers
    explanation = found_in(rig)
    assert names(explanation.found) == ["cause 2"]
    found = explanation.found[0]
    se = np.sqrt(found.covariance[0, 0])
    assert abs(found.values[0] - (25.0 + off[2])) < 3.0 * se
    assert 0.02 * 24.0 < se < 0.7  # the law is off by a fiftieth, besides
    assert found.probability > 0.99
    assert found.over_nothing > 100.0
    assert len(found.folds) == 4
    # Each of four trials shows it: 25 squared times 480 numbers of 0.09, less what the unknowns take.
    np.testing.assert_allclose(found.folds, 25.0**2 * 480 * 0.09, rtol=0.2)
    assert found.held_out > 0.9
    assert found.in_sample > 0.9
    assert explanation.explained > 0.9
    np.testing.assert_allclose(explanation.shared, [-4.0, 3.0, -2.0], atol=0.6)
    for local, own in zip(explanation.local, rig.own, strict=True):
        np.testing.assert_allclose(local, -own, atol=0.3)


def test_two_causes_are_found_the_larger_first():
    explanation = found_in(FakeRig({2: 20.0, 5: [40.0, -30.0]}))
    assert names(explanation.found) == ["cause 5", "cause 2"]
    # Columns are independent and alike in size, so shares are those of the squares: 2500 and 400 of 2900.
    for kind in ("in_sample", "held_out"):
        shares = [getattr(found, kind) for found in explanation.found]
        np.testing.assert_allclose(shares, [25 / 29, 4 / 29], atol=0.06)
        assert 0.95 < sum(shares) <= 1.0 + 1e-9
    np.testing.assert_allclose(explanation.found[0].values, [40.0, -30.0], atol=2.5)
    assert explanation.found[1].values[0] == pytest.approx(20.0, abs=2.5)
    assert diagnose(FakeRig({2: 20.0, 5: [40.0, -30.0]}), closed_loop=False).verdict == "explained"


def test_no_more_causes_than_asked_for():
    rig = FakeRig({k: 30.0 for k in range(3)})
    assert len(search(rig, most=2).best.free) == 2
    assert len(search(rig).best.free) == 3
    assert search(rig, most=0).best.free == ()


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


class ShapedRig(FakeRig):
    """The last cause is an event; in the catalogue's shape it has the trace of something else."""

    def columns(self, candidate):
        columns = super().columns(candidate)
        if candidate.cause != "event" or candidate.shape:
            return columns
        return [np.roll(c, 31, axis=0) for c in columns]

    def refinements(self, candidate, *, finer=False):
        return [] if finer or candidate.cause != "event" else [replace(candidate, shape={"right": 1.0})]


def test_event_is_found_in_a_shape_that_is_not_the_catalogues():
    catalogue = (*CATALOGUE, cause("event", tolerance=0.0))
    rig = ShapedRig({len(CATALOGUE): 8.0}, catalogue=catalogue, seed=5)
    explanation = found_in(rig)
    assert names(explanation.found) == ["event"]
    assert explanation.found[0].candidate.shape == {"right": 1.0}
    assert explanation.found[0].values[0] == pytest.approx(8.0, abs=0.5)
    unseen = score_of(Fit.of(Problem.of(rig.rows(rig.candidates()), rig.candidates())), len(CATALOGUE))
    assert unseen < rules.NAMED_NATS  # the scan alone would not have


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


def test_misfit_of_unknown_origin_is_unexplained():
    diagnosis = diagnose(FakeRig({}, foreign=3.0), closed_loop=False)
    assert diagnosis.verdict == "unexplained"
    assert diagnosis.causes == ()
    assert diagnosis.explanation.after > 5 * diagnosis.explanation.samples
    assert diagnosis.explanation.unlisted_nats > 1000.0


def test_foreign_misfit_in_one_octave_is_not_noise():
    """A process of its own in a cell, within what chi-square of all numbers would let pass."""
    rig = FakeRig({})
    time = np.arange(ROWS) / RATE_HZ
    for t, (x, *own) in enumerate(rig.data):
        rig.data[t] = x + 1.3 * np.sin(2 * np.pi * 0.3 * time + t)[:, None] * [1, 0, 0, 0], *own
    explanation = found_in(rig)
    assert explanation.found == ()
    assert explanation.unlisted_nats > rules.UNLISTED_NATS
    assert not explanation.clean


@pytest.mark.parametrize(("share", "unlisted"), [(0.0, True), (0.1, False), (0.02, True)])
def test_what_a_law_of_another_form_leaves_is_nothing_unlisted(share, unlisted):
    """A cause of 60 whose real form is off by 6 % of its trace at random: known to be off by ten, or by two."""
    catalogue = [replace(c, form_share=share) if k == 2 else c for k, c in enumerate(CATALOGUE)]
    rig, rng = FakeRig({2: 60.0}, catalogue=tuple(catalogue)), np.random.default_rng(8)
    for t, (x, *own) in enumerate(rig.data):
        rig.data[t] = x + 0.06 * 60.0 * 0.3 * rng.standard_normal(x.shape), *own
    best = search(rig).best
    assert [c.cause for c in best.causes] == ["cause 2"]
    assert (unlisted_nats(best) > rules.UNLISTED_NATS) is unlisted


def test_cause_within_a_larger_foreign_misfit_explains_a_part():
    diagnosis = diagnose(FakeRig({2: 40.0}, foreign=4.0), closed_loop=False)
    assert [f.candidate.cause for f in (*diagnosis.causes, *diagnosis.explanation.suspected)] == ["cause 2"]
    assert diagnosis.verdict in ("partly_explained", "unexplained")
    assert diagnosis.explanation.after > 5 * diagnosis.explanation.samples


def test_event_in_place_is_found_and_noise_alone_is_not():
    """A burst that the event's columns make, and one of random numbers that they merely overfit."""
    explanation = found_in(with_push(FakeRig({}, burst=(1, 0.0, 2)), [3.0, -2.0]))
    (found,) = explanation.found
    assert found.candidate.transient == Transient(1, 3.2, 4.0)
    assert np.all(np.abs(found.values - [3.0, -2.0]) < 3.0 * np.sqrt(np.diag(found.covariance)))
    assert found.held_out is None
    assert found.folds == ()
    assert found.over_nothing > 100.0

    for size, columns in ((4.0, 60), (30.0, 100)):
        overfit = found_in(FakeRig({}, burst=(1, size, columns)))
        assert names(overfit.found) == []


class Overlapping(FakeRig):
    """Two events of one kind whose intervals overlap, one that does not."""

    INTERVALS = ((20, 60), (45, 85), (90, 115))

    def transients(self, remaining):
        return [
            cause("push", None, 0.0, 1, "push", Transient(1, first / RATE_HZ, (last - first) / RATE_HZ))
            for first, last in self.INTERVALS
        ]

    def _burst_columns(self, t, candidate):
        out = np.zeros((ROWS, CHANNELS, 1))
        if t == candidate.transient.trial:
            for first, last in self.INTERVALS:
                if abs(candidate.transient.start_s - first / RATE_HZ) < 1e-9:
                    pattern = np.random.default_rng(first).standard_normal((last - first, CHANNELS, 1))
                    out[first:last] = pattern
        return out


def test_events_that_overlap_are_one():
    """What is left of one is its form; one that acts later is another."""
    rig = with_push(Overlapping({}), [9.0], 0)
    explanation = found_in(with_push(rig, [4.0], 1))
    assert [f.candidate.transient.start_s for f in explanation.found] == [20 / RATE_HZ]

    rig = with_push(Overlapping({}), [9.0], 0)
    explanation = found_in(with_push(rig, [4.0], 2))
    starts = sorted(f.candidate.transient.start_s for f in explanation.found)
    assert starts == [20 / RATE_HZ, 90 / RATE_HZ]


def test_look_alike_is_a_rival_at_its_distance():
    rig = FakeRig({2: 25.0}, twins=TWINS)
    diagnosis = diagnose(rig, closed_loop=False)
    assert len(diagnosis.causes) == 1
    named = diagnosis.causes[0].candidate.cause
    assert named in ("cause 2", "cause 4")
    alternatives = diagnosis.alternatives[0]
    assert alternatives[0].candidate.cause == ("cause 4" if named == "cause 2" else "cause 2")
    assert all(a.evidence_gap > 20 for a in alternatives[1:])
    gap = alternatives[0].evidence_gap
    assert 0 <= gap < 5
    assert alternatives[0].ambiguous
    assert alternatives[0].chi2_per_n is None
    assert diagnosis.causes[0].probability == pytest.approx(1.0 / (1.0 + np.exp(-gap)), abs=0.01)

    told = diagnose(FakeRig({2: 25.0}, twins={4: (2, 0.04)}), closed_loop=False)
    assert names(told.causes) == ["cause 2"]
    assert told.alternatives[0][0].candidate.cause == "cause 4"
    assert told.alternatives[0][0].evidence_gap > 20
    assert not told.alternatives[0][0].ambiguous


def test_gap_is_the_difference_of_scores():
    """Of the hypotheses with the one and the other, each from the start."""
    rig = FakeRig({2: 25.0}, twins={4: (2, 0.04)})
    searched = search(rig)
    problem = Problem.of(rig.rows(rig.candidates()), rig.candidates())
    scores = [Hypothesis.of(problem, [i]).score for i in (2, 4)]
    rivals = {None if r.candidate is None else r.candidate.cause: r.gap for r in searched.rivals[0]}
    assert rivals["cause 4"] == pytest.approx(scores[0] - scores[1], abs=6 * rules.LEARN_NATS)
    assert rivals[None] == pytest.approx(
        scores[0] - Hypothesis.of(problem, []).score, abs=6 * rules.LEARN_NATS
    )


def test_one_among_many_alike_is_named_with_its_look_alikes():
    """Of four that leave the same trace none is likelier than not; that it is one of them is as good as certain."""
    diagnosis = diagnose(FakeRig({2: 25.0}, twins={k: (2, 0.0005) for k in (4, 6, 7)}), closed_loop=False)
    (found,) = diagnosis.causes
    alike = [a.candidate.cause for a in diagnosis.alternatives[0] if a.ambiguous]
    assert sorted([found.candidate.cause, *alike]) == ["cause 2", "cause 4", "cause 6", "cause 7"]
    gaps = [a.evidence_gap for a in diagnosis.alternatives[0] if a.ambiguous]
    assert found.probability == pytest.approx(1.0 / (1.0 + np.sum(np.exp(-np.array(gaps)))), abs=0.01)
    assert found.probability < 0.5
    assert found.probability_alike > 0.99


class Lawless(FakeRig):
    """Something unlisted whose trace is that of cause 2 but for as much again, of another kind."""

    def __post_init__(self):
        super().__post_init__()
        rng = np.random.default_rng(9)
        for t, (x, *own) in enumerate(self.data):
            self.data[t] = x + 25.0 * 0.3 * rng.standard_normal(x.shape), *own


def test_what_leaves_as_much_as_it_explains_is_suspected_only():
    diagnosis = diagnose(Lawless({2: 25.0}), closed_loop=False)
    assert diagnosis.causes == ()
    (suspect,) = diagnosis.explanation.suspected
    assert suspect.candidate.cause == "cause 2"
    assert suspect.share_left == pytest.approx(np.sqrt(0.5), abs=0.07)
    assert suspect.over_nothing > 10.0
    assert suspect.probability <= suspect.probability_alike < rules.LEAST_PROBABILITY
    assert diagnosis.explanation.hypothesis.free == ()
    assert diagnosis.verdict == "unexplained"


def test_single_trial_says_so():
    diagnosis = diagnose(FakeRig({2: 40.0}, trials=("only",)), closed_loop=False)
    assert names(diagnosis.causes) == ["cause 2"]
    assert diagnosis.causes[0].held_out is None
    assert any("One trial only" in note for note in diagnosis.notes)


def test_progress_is_told():
    said, simulated = [], []
    rig = FakeRig({2: 25.0}, loop=lambda c, t: 1.1 if c else 9.0)
    diagnose(rig, say=said.append, simulated=simulated.append)
    assert said[0] == "columns"
    assert "scan" in said
    assert "simulate" in said
    assert any(what.startswith("refit cause 2") for what in said)
    assert sum(simulated) == len(rig.calls)


@dataclass
class Sum(FakeRig):
    """Cause 6 leaves nearly the trace of causes 0 and 1 together."""

    def __post_init__(self):
        super().__post_init__()
        key = self.catalogue[6].key
        parts = [self.columns_of[self.catalogue[k].key] for k in (0, 1)]
        self.columns_of[key] = [
            a + b + 0.065 * c for a, b, c in zip(*parts, self.columns_of[key], strict=True)
        ]
        for t, (x, *own) in enumerate(self.data):
            self.data[t] = x + 20.0 * (parts[0][t] + parts[1][t])[..., 0], *own


def test_what_the_first_guess_left_goes_once_the_right_ones_stand_there():
    """One that accounts for most comes first, the two behind it are found, and it is taken away."""
    said = []
    catalogue = (*CATALOGUE[:6], cause("cause 6", tolerance=0.0), CATALOGUE[7])
    explanation = explain(search(Sum({}, catalogue=catalogue), progress=said.append))
    assert next(what for what in said if what.startswith("refit")).startswith("refit cause 6")
    assert sorted(names(explanation.found)) == ["cause 0", "cause 1"]
    for found in explanation.found:
        assert found.values[0] == pytest.approx(20.0, abs=3.0)


class OpenRig(FakeRig):
    """Cause 2 leaves open sixty numbers a trial, of its own size."""

    def unknowns(self, candidate):
        count = 60 if candidate.cause == "cause 2" else 0
        rng = np.random.default_rng(11)
        return [Patches.of(0.3 * rng.standard_normal((ROWS, CHANNELS, count))) for _ in self.trials]


SMALL = tuple(cause(f"cause {k}", tolerance=0.1) for k in range(8))


def test_what_a_cause_leaves_open_is_integrated_out():
    """It is there: the cause has its value, and what is left is noise."""
    rig = OpenRig({2: 25.0}, catalogue=SMALL)
    rng = np.random.default_rng(5)
    for t, u in enumerate(rig.unknowns(SMALL[2])):
        x, *own = rig.data[t]
        rig.data[t] = x + 2.5 * u.dense() @ rng.standard_normal(60), *own
    explanation = found_in(rig)
    assert names(explanation.found) == ["cause 2"]
    assert list(explanation.problem.opened) == [SMALL[2].key]
    (found,) = explanation.found
    assert abs(found.values[0] - 2.5) < 3.5 * np.sqrt(found.covariance[0, 0])
    assert explanation.clean
    # What a healthy one would explain of it is not to its credit.
    assert explanation.hypothesis.allowed[found.index] > 100.0
    healthy = Hypothesis.of(explanation.problem, ())
    assert explanation.hypothesis.score - healthy.score < found.over_nothing + 0.2
    # Nor in the list of the strongest: but for the prior odds it has there what the search gave it.
    first = evidence_list(explanation)["before"][0]
    assert first["cause"] == "cause 2"
    assert first["nats"] - first["needed"] + rules.NAMED_NATS == pytest.approx(found.over_nothing, rel=0.05)


class HoldingRig(OpenRig):
    """What cause 2 leaves open can all but imitate it, as friction at rest does where a joint hardly moves."""

    def unknowns(self, candidate):
        opened = super().unknowns(candidate)
        if candidate.cause != "cause 2":
            return opened
        return [u.beside([Patches.of(c)]) for u, c in zip(opened, self.columns(candidate), strict=True)]


def test_what_a_cause_explains_with_nothing_open_stays_to_it():
    rig = HoldingRig({2: 25.0}, catalogue=SMALL)
    rng = np.random.default_rng(5)
    for t, u in enumerate(rig.unknowns(SMALL[2])):
        x, *own = rig.data[t]
        rig.data[t] = x + 2.5 * u.dense()[..., :60] @ rng.standard_normal(60), *own
    nothing = search(rig).nothing
    alone = Hypothesis.of(nothing.problem, [2])
    best = proposals(rig, nothing).best
    assert best.free == (2,)
    assert list(best.problem.opened) == [SMALL[2].key]
    assert best.fit.chi2 < 0.7 * alone.fit.chi2
    assert best.score == pytest.approx(alone.score, abs=1e-6)
    assert alone.score > nothing.score + rules.NAMED_NATS


def test_what_is_left_open_at_rest_is_not_charged_where_it_tells_nothing():
    explanation = found_in(OpenRig({2: 25.0, 5: 400.0}, catalogue=SMALL))
    assert names(explanation.found) == ["cause 5", "cause 2"]
    assert explanation.problem.opened == {}


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
