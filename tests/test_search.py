"""Search and diagnosis on a rig of pure numbers, where the truth is known."""

from dataclasses import replace

import numpy as np
import pytest

from discrepancy.diagnose import _verdict, diagnose
from discrepancy.explanation import CLEAN
from discrepancy.held_out import confirmed
from discrepancy.problem import Problem
from discrepancy.search import _idle, search
from fake_rig import CATALOGUE, FakeRig, cause

TWINS = {4: (2, 0.005)}  # cause 4 leaves the trace of cause 2, but for half a percent


def names(found):
    return [f.candidate.cause for f in found]


@pytest.mark.parametrize("seed", range(8))
def test_clean_data_have_no_cause(seed):
    rig = FakeRig({}, seed=seed)
    explanation = search(rig)
    assert names(explanation.found) == []
    assert explanation.rejected == ()
    assert explanation.samples == 4 * 120 * 4
    assert explanation.after == explanation.before < CLEAN * explanation.samples
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
        ([3.0, 9.0, -3.0, -3.0], False),  # two of four
        ([3.0, 9.0, -1.0, -1.9], True),  # two of two: the others do not show it
        ([9.0, -1.0, -1.0, -1.0], False),  # one alone
        ([9.0, 8.0, 7.0, -3.0], True),  # three of four
        ([1.0, 1.0, 1.0, -4.0], False),  # worse in all
        ([9.0, 1.0, -3.0], False),  # two of three
    ],
)
def test_trials_that_confirm(folds, expected):
    assert confirmed(folds) is expected


def test_two_causes_are_found_the_larger_first():
    explanation = search(FakeRig({2: 20.0, 5: [40.0, -30.0]}))
    assert names(explanation.found) == ["cause 5", "cause 2"]
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
    unseen = Problem.of(rig.rows(rig.candidates()), rig.candidates()).fit().evidence_of(len(CATALOGUE))
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
            return [cause("push", None, 0.2, 2, "push", super().transients(remaining)[0].detail)]

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
    misfits = [problem.fit([problem.index_of(c)]).misfit for c in (found.candidate, rival)]
    assert gap == pytest.approx(0.5 * (misfits[1] - misfits[0]), rel=1e-6)


def test_single_trial_says_so():
    diagnosis = diagnose(FakeRig({2: 40.0}, trials=("only",)), closed_loop=False)
    assert names(diagnosis.causes) == ["cause 2"]
    assert diagnosis.causes[0].held_out is None
    assert any("One trial only" in note for note in diagnosis.notes)


@pytest.mark.parametrize(
    ("nominal", "plain", "expected"),
    [
        (10.0, 1.15, 1.0),
        (10.0, 1.0, 1.0),
        (10.0, 10.0, 0.0),
        (10.0, 5.575, 0.5),
        (1.2, 1.1, 1.0),
        (1.0, 2.0, 0.0),
    ],
)
def test_share_of_the_misfit(nominal, plain, expected):
    explanation = search(FakeRig({}))
    n = explanation.samples
    assert replace(explanation, nominal=nominal * n, plain=plain * n).explained == pytest.approx(expected)


def test_misfits_are_those_of_four_fits():
    rig = FakeRig({2: 25.0})
    explanation = search(rig)
    problem = Problem.of(rig.rows(rig.candidates()), rig.candidates())
    assert explanation.nominal == pytest.approx(problem.fit(background=False).misfit)
    assert explanation.before == pytest.approx(problem.fit().misfit)
    assert explanation.plain == pytest.approx(problem.fit([2], background=False).misfit)
    assert explanation.after == pytest.approx(problem.fit([2]).misfit)


@pytest.mark.parametrize(
    ("nominal", "plain", "after", "causes", "expected"),
    [
        (10.0, 2.0, 1.15, 1, "explained"),  # clean with tolerances
        (5.0, 5.0, 1.15, 0, "consistent"),
        (5.0, 5.0, 1.16, 0, "unexplained"),
        (10.0, 2.91, 2.9, 1, "explained"),  # 80 % of 8.85
        (10.0, 2.93, 2.9, 1, "partly_explained"),
        (10.0, 7.34, 2.0, 1, "partly_explained"),  # 30 %
        (10.0, 7.35, 2.0, 1, "unexplained"),
    ],
)
def test_verdict_boundaries(nominal, plain, after, causes, expected):
    explanation = search(FakeRig({2: 25.0}))
    n = explanation.samples
    sizes = {"nominal": nominal * n, "plain": plain * n, "after": after * n}
    assert _verdict(replace(explanation, found=explanation.found[:causes], **sizes)) == expected


def test_three_causes_at_one_robot_only_add_up():
    explanation = search(FakeRig({k: 30.0 for k in (1, 2, 3)}))
    assert len(explanation.found) == 3
    assert explanation.clean
    assert _verdict(explanation) == "unexplained"
    assert _verdict(replace(explanation, found=explanation.found[:2])) == "explained"


def test_of_three_at_one_robot_a_transient_goes_first():
    """Two causes at one robot are believed without the push that took what they left."""
    rig = FakeRig({1: 30.0, 2: 30.0}, burst=(1, 0.0, 2))
    push = rig.transients([])[0]
    x, local, shared = rig.data[1]
    rig.data[1] = x + rig.columns(push)[1] @ np.array([3.0, -2.0]), local, shared
    assert sorted(names(search(rig).found)) == ["cause 1", "cause 2", "push"]
    diagnosis = diagnose(rig, closed_loop=False)
    assert sorted(names(diagnosis.causes)) == ["cause 1", "cause 2"]
    assert diagnosis.verdict == "explained"
    assert any("takes what the other causes leave" in note for note in diagnosis.notes)


def test_three_causes_at_several_robots_are_believed_if_they_are_of_three_families():
    explanation = search(FakeRig({k: 30.0 for k in (1, 2, 3)}))
    first, *others = explanation.found

    def verdict(*families):
        moved = [
            replace(found, candidate=replace(found.candidate, robot=robot, family=family))
            for robot, (found, family) in enumerate(zip((first, *others), families, strict=True), start=1)
        ]
        return _verdict(replace(explanation, found=tuple(moved)))

    assert verdict("a", "b", "c") == "explained"
    assert verdict("a", "b", "a") == "unexplained"


def test_strained_tolerances_are_not_clean():
    """Six causes at 3.5 times their tolerance: none stands out, together they are no chance."""
    rig = FakeRig({k: 4.5 for k in range(5)})
    problem = Problem.of(rig.rows(rig.candidates()), rig.candidates())
    explanation = replace(search(FakeRig({})), fit=problem.fit())
    assert explanation.after <= CLEAN * explanation.samples
    assert not explanation.clean
    assert _verdict(explanation) == "unexplained"


# With a closed loop.


def test_clean_data_are_simulated_once():
    rig = FakeRig({}, loop=lambda causes, trial: 1.5)
    diagnosis = diagnose(rig)
    assert diagnosis.verdict == "consistent"
    assert diagnosis.not_simulated is None
    assert diagnosis.gain.before == diagnosis.gain.after
    assert len(rig.calls) == 4
    assert diagnosis.gain.before[0].chi2_per_n == pytest.approx(1.5)


def test_named_cause_that_simulates_better_stays():
    rig = FakeRig({2: 25.0}, twins=TWINS, loop=lambda c, t: {(): 9.0}.get(c, 1.1 if "cause 2" in c else 5.0))
    diagnosis = diagnose(rig)
    assert names(diagnosis.causes) == ["cause 2"]
    assert [r.chi2_per_n for r in diagnosis.gain.before] == pytest.approx([9.0] * 4)
    assert [r.chi2_per_n for r in diagnosis.gain.after] == pytest.approx([1.1] * 4)
    alternative = diagnosis.alternatives[0][0]
    assert alternative.candidate.cause == "cause 4"
    assert alternative.chi2_per_n == pytest.approx(5.0)
    assert not alternative.ambiguous  # the rows cannot tell them apart, the closed loop can
    assert diagnosis.verdict == "explained"
    assert diagnosis.gain.removed()[0] == pytest.approx(1 - np.sqrt(0.1 / 8.0))


def test_rival_that_simulates_better_takes_the_place():
    first = search(FakeRig({2: 25.0}, twins=TWINS)).found[0].candidate.cause
    second = {"cause 2": "cause 4", "cause 4": "cause 2"}[first]
    rig = FakeRig({2: 25.0}, twins=TWINS, loop=lambda c, t: {(): 9.0}.get(c, 1.1 if second in c else 5.0))
    diagnosis = diagnose(rig)
    assert names(diagnosis.causes) == [second]
    assert diagnosis.causes[0].values[0] == pytest.approx(25.0, abs=2.5)
    assert diagnosis.causes[0].held_out > 0.9
    assert any(first in note and second in note for note in diagnosis.notes)
    assert [r.chi2_per_n for r in diagnosis.gain.after] == pytest.approx([1.1] * 4)
    other = diagnosis.alternatives[0][0]
    assert other.candidate.cause == first
    assert other.chi2_per_n == pytest.approx(5.0)
    assert not other.ambiguous


def test_equally_good_rivals_stay_ambiguous():
    rig = FakeRig({2: 25.0}, twins=TWINS, loop=lambda c, t: 1.1 if c else 9.0)
    alternative = diagnose(rig).alternatives[0][0]
    assert alternative.ambiguous
    assert alternative.chi2_per_n == pytest.approx(1.1)


def test_rival_that_fails_to_simulate_is_no_rival():
    first = search(FakeRig({2: 25.0}, twins=TWINS)).found[0].candidate.cause
    rig = FakeRig({2: 25.0}, twins=TWINS, loop=lambda c, t: 9.0 if not c else 1.1 if first in c else None)
    diagnosis = diagnose(rig)
    assert names(diagnosis.causes) == [first]
    assert not diagnosis.alternatives[0][0].ambiguous


def test_cause_that_worsens_the_response_is_dropped():
    rig = FakeRig({2: 25.0}, loop=lambda c, t: 8.0 if c else 2.0)
    diagnosis = diagnose(rig)
    assert diagnosis.causes == ()
    assert diagnosis.alternatives == ()
    assert diagnosis.verdict == "unexplained"
    assert any("makes the response to the commands worse (chi2/n 2 to 8)" in note for note in diagnosis.notes)
    assert diagnosis.gain.after == diagnosis.gain.before


def test_cause_that_cannot_be_simulated_is_dropped():
    diagnosis = diagnose(FakeRig({2: 25.0}, loop=lambda c, t: None if c else 9.0))
    assert diagnosis.causes == ()
    assert diagnosis.notes == (
        "cause 2 (robot 1): with it the recorded commands cannot be simulated, so it is not named.",
    )


def test_every_trial_is_simulated_with_what_the_others_say():
    """The cause is there in the third trial only half as much: that trial's own prediction does not know."""
    rig = FakeRig({2: 25.0}, loop=lambda c, t: 1.1 if c else 9.0)
    diagnose(rig)
    with_cause = {trial: values[0][0] for trial, causes, values in rig.calls if causes == ("cause 2",)}
    whole = search(rig).found[0].values[0]
    assert len({round(v, 6) for v in with_cause.values()}) == 4
    for t, value in with_cause.items():
        rest = FakeRig({2: 25.0})
        rest.data = [d for k, d in enumerate(rest.data) if k != t]
        rest.columns_of = {key: [c for k, c in enumerate(v) if k != t] for key, v in rest.columns_of.items()}
        rest.trials = tuple(n for k, n in enumerate(rest.trials) if k != t)
        # Alone in the model: no other cause within its tolerance shares the work.
        problem = Problem.of(rest.rows(rest.candidates()), rest.candidates())
        assert value == pytest.approx(problem.fit([2], background=False).part(2)[0][0], rel=1e-9)
        assert value == pytest.approx(whole, rel=0.1)


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
    problem = Problem.of(rig.rows(rig.candidates()), rig.candidates())
    assert _idle(problem, [2, 5]) == []
    assert _idle(problem, [5, 2]) == []
    assert _idle(problem, [6, 5, 2]) == [0]
    assert _idle(problem, [5, 6, 2]) == [1]
    assert _idle(problem, [5, 2, 6]) == []
    assert _idle(problem, [6]) == []


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


def test_three_transients_are_not_dropped_into_silence():
    """Only one among lasting causes goes; three events stay a verdict of their own, never ``consistent``."""
    three = [replace(c, detail={"trial": float(k)}) for k, c in enumerate(CATALOGUE[1:4])]
    rig = FakeRig({k: 30.0 for k in (1, 2, 3)})
    explanation = search(rig)
    assert len(explanation.found) == 3
    found = tuple(replace(f, candidate=c) for f, c in zip(explanation.found, three, strict=True))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("discrepancy.diagnose.search", lambda *_, **__: replace(explanation, found=found))
        diagnosis = diagnose(rig, closed_loop=False)
    assert diagnosis.verdict == "unexplained"
    assert not any("takes what the other causes leave" in note for note in diagnosis.notes)
