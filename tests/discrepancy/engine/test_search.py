"""Search and diagnosis on a rig of pure numbers, where the truth is known."""

from dataclasses import replace

import numpy as np
import pytest

from discrepancy.engine.diagnose import diagnose
from discrepancy.engine.held_out import confirmed
from discrepancy.inference.refit import explanation_of, idlest, refit, without_idle
from discrepancy.inference.search import search
from discrepancy.least_squares.fit import Fit
from discrepancy.least_squares.problem import Problem
from discrepancy.rules import CLEAN_CHI2_PER_N
from fake_rig import CATALOGUE, TWINS, FakeRig, cause, names


@pytest.mark.parametrize("seed", range(8))
def test_clean_data_have_no_cause(seed):
    rig = FakeRig({}, seed=seed)
    explanation = search(rig)
    assert names(explanation.found) == []
    assert explanation.rejected == ()
    assert explanation.samples == 4 * 120 * 4
    assert explanation.after == explanation.before < CLEAN_CHI2_PER_N * explanation.samples
    diagnosis = diagnose(rig, closed_loop=False)
    assert diagnosis.verdict == "consistent"
    assert diagnosis.not_simulated
    assert diagnosis.notes == ()


@pytest.mark.parametrize("seed", [1, 2])
def test_one_cause_is_found_with_its_value(seed):
    rig = FakeRig({2: 25.0}, seed=seed)
    explanation = search(rig)
    assert names(explanation.found) == ["cause 2"]
    found = explanation.found[0]
    # It is a tolerance off besides.
    assert found.values[0] == pytest.approx(25.0, abs=2.5)
    assert 0 < found.covariance[0, 0] < 0.2**2
    assert found.evidence.log10_p < -20
    assert len(found.folds) == 4
    assert min(found.folds) > 0
    assert found.held_out > 0.9
    assert found.in_sample > 0.9
    assert explanation.explained > 0.9
    np.testing.assert_allclose(explanation.shared, [-4.0, 3.0, -2.0], atol=0.6)
    for local, own in zip(explanation.local, rig.own, strict=True):
        np.testing.assert_allclose(local, -own, atol=0.3)


@pytest.mark.parametrize(
    ("folds", "expected"),
    [
        ([], True),
        ([-5.0], True),
        ([3.0, 1.0, 2.0, -1.0], True),
        ([3.0, 9.0, -3.0, -3.0], False),  # half as much harm as help
        ([3.0, 9.0, -1.0, -1.9], True),  # two hardly show it
        ([9.0, -1.0, -1.0, -1.0], False),  # one alone
        ([7.0, 49.0, -4.0, -0.1], True),
        ([1.0, 1.0, 1.0, -4.0], False),  # worse in all
        ([0.0, 0.0, 0.0], False),
    ],
)
def test_trials_that_confirm(folds, expected):
    assert confirmed(folds) is expected


def test_two_causes_are_found_the_larger_first():
    explanation = search(FakeRig({2: 20.0, 5: [40.0, -30.0]}))
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
    rig = FakeRig({k: 30.0 for k in range(5)})
    assert len(search(rig, most=2).found) == 2
    assert len(search(rig).found) == 3


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
    explanation = search(rig)
    assert names(explanation.found) == ["event"]
    assert explanation.found[0].candidate.shape == {"right": 1.0}
    assert explanation.found[0].values[0] == pytest.approx(8.0, abs=0.5)
    unseen = Fit.of(Problem.of(rig.rows(rig.candidates()), rig.candidates())).evidence_of(len(CATALOGUE))
    assert unseen.log10_p > -2  # the scan alone would not have


def test_misfit_of_unknown_origin_is_unexplained():
    rig = FakeRig({}, foreign=3.0)
    diagnosis = diagnose(rig, closed_loop=False)
    assert diagnosis.verdict == "unexplained"
    assert diagnosis.causes == ()
    assert diagnosis.explanation.after > 5 * diagnosis.explanation.samples


def test_cause_within_a_larger_foreign_misfit_explains_a_part():
    diagnosis = diagnose(FakeRig({2: 25.0}, foreign=4.0), closed_loop=False)
    assert names(diagnosis.causes) == ["cause 2"]
    assert diagnosis.verdict == "partly_explained"
    assert diagnosis.causes[0].values[0] == pytest.approx(25.0, abs=4.0)


def test_cause_that_acts_in_one_trial_only_is_rejected():
    """A large error in one trial is significant, yet other trials do not know of it."""
    rig = FakeRig({}, catalogue=(*CATALOGUE[:3], cause("cause 3", tolerance=0.05), *CATALOGUE[4:]))
    x, local, shared = rig.data[1]
    rig.data[1] = x + rig.columns(rig.catalogue[3])[1] @ np.array([8.0]), local, shared
    explanation = search(rig)
    assert "cause 3" not in names(explanation.found)
    assert "cause 3" in [c.cause for c in explanation.rejected]
    assert diagnose(rig, closed_loop=False).verdict == "unexplained"


def test_transient_in_place_is_found_and_noise_alone_is_not():
    """A burst that the transient's columns make, and one of random numbers that they merely overfit."""
    rig = FakeRig({}, burst=(1, 0.0, 2))
    push = rig.transients([])[0]
    x, local, shared = rig.data[1]
    rig.data[1] = x + rig.columns(push)[1] @ np.array([3.0, -2.0]), local, shared
    explanation = search(rig)
    assert names(explanation.found) == ["push"]
    np.testing.assert_allclose(explanation.found[0].values, [3.0, -2.0], atol=0.4)
    assert explanation.found[0].held_out is None

    overfit = search(FakeRig({}, burst=(1, 4.0, 60)))
    assert names(overfit.found) == []
    assert [c.cause for c in overfit.rejected] in ([], ["push"])


def test_short_transient_with_a_tolerance_is_tested_inside_its_interval():
    """It is there for 2 s; taking out the trial's own unknowns leaves a trace of its columns in all 10 s of it."""

    class ShortRig(FakeRig):
        def _burst_columns(self, t, candidate):
            columns = super()._burst_columns(t, candidate)
            columns[:50], columns[76:] = 0.0, 0.0
            return columns

        def transients(self, remaining):
            return [cause("push", None, 0.2, 2, "push", super().transients(remaining)[0].transient)]

    rig = ShortRig({}, burst=(1, 0.0, 2))
    push = rig.transients([])[0]
    x, local, shared = rig.data[1]
    rig.data[1] = x + rig.columns(push)[1] @ np.array([4.0, -3.0]), local, shared
    explanation = search(rig)
    assert names(explanation.found) == ["push"]
    assert len(explanation.found[0].folds) == 4
    assert min(explanation.found[0].folds) > 0.1 * sum(explanation.found[0].folds)  # each has a share of it
    np.testing.assert_allclose(explanation.found[0].values, [4.0, -3.0], atol=0.6)


def test_overfit_transient_is_rejected_by_blocks_left_out():
    """A hundred columns always find something in 200 numbers of a large misfit; what they find does not carry over."""
    rig = FakeRig({}, burst=(1, 30.0, 100))
    explanation = search(rig)
    assert names(explanation.found) == []
    assert "push" in [c.cause for c in explanation.rejected]


def test_look_alike_is_a_rival_at_its_distance():
    rig = FakeRig({2: 25.0}, twins=TWINS)
    diagnosis = diagnose(rig, closed_loop=False)
    assert len(diagnosis.causes) == 1
    named = diagnosis.causes[0].candidate.cause
    assert named in ("cause 2", "cause 4")
    alternatives = diagnosis.alternatives[0]
    assert [a.candidate.cause for a in alternatives] == ["cause 4" if named == "cause 2" else "cause 2"]
    assert 0 <= alternatives[0].evidence_gap < 5
    assert alternatives[0].ambiguous
    assert alternatives[0].chi2_per_n is None

    told = diagnose(FakeRig({2: 25.0}, twins={4: (2, 0.04)}), closed_loop=False)
    assert names(told.causes) == ["cause 2"]
    assert told.alternatives[0][0].candidate.cause == "cause 4"
    assert told.alternatives[0][0].evidence_gap > 20
    assert not told.alternatives[0][0].ambiguous


def test_rows_gap_is_half_the_difference_of_misfits():
    rig = FakeRig({2: 25.0}, twins={4: (2, 0.04)})
    explanation = search(rig)
    found = explanation.found[0]
    rival, gap = found.rivals[0]
    problem = explanation.problem
    misfits = [Fit.of(problem, [problem.index_of(c)]).misfit for c in (found.candidate, rival)]
    assert gap == pytest.approx(0.5 * (misfits[1] - misfits[0]), rel=1e-6)


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
    assert "simulate" in said
    assert sum(simulated) == len(rig.calls)


def test_what_tells_nothing_beside_the_others_is_dropped():
    """The last one named is never the idle one; of the others the one without evidence is."""
    rig = FakeRig({2: 20.0, 5: [40.0, -30.0]})
    explanation = search(rig)
    problem = Problem.of(rig.rows(rig.candidates()), rig.candidates())

    def idle(free, among):
        named = [replace(explanation.found[0], index=index) for index in among]
        found = idlest(Fit.of(problem, free), named)
        return None if found is None else found.index

    assert idle([2, 5], [2]) is None
    assert idle([5, 2], [5]) is None
    assert idle([6, 5, 2], [6, 5]) == 6
    assert idle([5, 6, 2], [5, 6]) == 6
    assert idle([5, 2, 6], [5, 2]) is None
    assert idle([5, 2, 6], [5, 2, 6]) == 6


def test_what_a_replaced_cause_left_goes_with_it():
    """Cause 6 is not there; once the right one stands beside it, nothing speaks for it."""
    rig = FakeRig({2: 20.0, 5: [40.0, -30.0]})
    explanation = search(rig)
    assert names(explanation.found) == ["cause 5", "cause 2"]
    none = replace(explanation.found[0], index=6, candidate=CATALOGUE[6])
    fit = refit(rig, explanation.problem, [6, 5, 2])
    three = explanation_of(rig, fit, [none, *explanation.found], [], nominal=1e5, before=1e5)
    rest = without_idle(rig, three)
    assert names(rest.found) == ["cause 5", "cause 2"]
    assert rest.fit.free == (5, 2)
    assert rest.after == pytest.approx(explanation.after, rel=1e-6)
    np.testing.assert_allclose(rest.found[1].values, explanation.found[1].values, rtol=1e-3)
    assert without_idle(rig, explanation) is explanation


def test_what_is_left_open_at_rest_is_not_charged_where_it_tells_nothing():
    """A second cause with sixty open columns a trial, none of which is needed: they cost more than it explains."""

    class OpenRig(FakeRig):
        def unknowns(self, candidate):
            count = 60 if candidate.cause == "cause 2" else 0
            rng = np.random.default_rng(11)
            return [rng.standard_normal((120, 4, count)) for _ in self.trials]

    catalogue = tuple(cause(f"cause {k}", tolerance=0.1) for k in range(8))
    explanation = search(OpenRig({2: 25.0, 5: 400.0}, catalogue=catalogue))
    assert names(explanation.found) == ["cause 5", "cause 2"]
