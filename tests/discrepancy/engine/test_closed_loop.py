"""Named causes and their rivals in a closed loop that is made up: who stays, who goes, who is ambiguous."""

import numpy as np
import pytest

from discrepancy import rules
from discrepancy.engine.diagnose import diagnose
from discrepancy.engine.explanation import explain
from discrepancy.inference.search import search
from discrepancy.least_squares.fit import Fit
from discrepancy.least_squares.problem import Problem
from fake_rig import TWINS, FakeRig, names


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
    assert alternative.evidence_gap <= rules.AMBIGUOUS_NATS
    assert not alternative.ambiguous  # the rows cannot tell them apart, the closed loop can
    assert diagnosis.causes[0].probability > 0.98
    assert diagnosis.verdict == "explained"
    assert diagnosis.gain.removed()[0] == pytest.approx(1 - np.sqrt(0.1 / 8.0))


def test_rival_that_simulates_better_takes_the_place():
    first = explain(search(FakeRig({2: 25.0}, twins=TWINS))).found[0].candidate.cause
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
    rows_alone = diagnose(FakeRig({2: 25.0}, twins=TWINS), closed_loop=False)
    assert diagnose(rig).causes[0].probability == pytest.approx(rows_alone.causes[0].probability)
    assert rows_alone.causes[0].probability < 0.9


def test_only_rivals_that_the_rows_cannot_tell_are_simulated():
    rig = FakeRig({2: 25.0}, twins={4: (2, 0.04)}, loop=lambda c, t: 1.1 if c else 9.0)
    diagnosis = diagnose(rig)
    assert {causes for _, causes, _ in rig.calls} == {(), ("cause 2",)}
    assert diagnosis.alternatives[0][0].candidate.cause == "cause 4"
    assert diagnosis.alternatives[0][0].chi2_per_n is None


def test_rival_that_fails_to_simulate_is_no_rival():
    first = explain(search(FakeRig({2: 25.0}, twins=TWINS))).found[0].candidate.cause
    rig = FakeRig({2: 25.0}, twins=TWINS, loop=lambda c, t: 9.0 if not c else 1.1 if first in c else None)
    diagnosis = diagnose(rig)
    assert names(diagnosis.causes) == [first]
    assert not diagnosis.alternatives[0][0].ambiguous


def test_cause_that_worsens_the_response_is_doubted():
    """It stays, with half its probability; the verdict is weakened."""
    rig = FakeRig({2: 25.0}, loop=lambda c, t: 8.0 if c else 2.0)
    diagnosis = diagnose(rig)
    assert names(diagnosis.causes) == ["cause 2"]
    sure = diagnose(FakeRig({2: 25.0}, loop=lambda c, t: 1.5 if c else 2.0))
    assert sure.verdict == "explained"
    assert sure.causes[0].probability > 0.99
    (doubted,) = diagnosis.causes
    assert doubted.probability == pytest.approx(rules.CONTRADICTED * sure.causes[0].probability)
    assert doubted.probability_alike == pytest.approx(rules.CONTRADICTED * sure.causes[0].probability_alike)
    assert diagnosis.verdict == "partly_explained"
    assert any(
        "makes the response to the commands worse (chi2/n 2 to 8), which speaks against it" in note
        for note in diagnosis.notes
    )
    assert [r.chi2_per_n for r in diagnosis.gain.after] == pytest.approx([8.0] * 4)


def test_response_that_is_as_bad_within_the_margin_is_no_contradiction():
    for after, doubted in ((1.0 + 0.9 * rules.MARGIN_SHARE, False), (1.0 + 1.1 * rules.MARGIN_SHARE, True)):
        diagnosis = diagnose(FakeRig({2: 25.0}, loop=lambda c, t, after=after: 2.0 * after if c else 2.0))
        assert (diagnosis.verdict == "partly_explained") is doubted
        assert (diagnosis.causes[0].probability < 0.6) is doubted


def test_cause_that_cannot_be_simulated_is_doubted():
    diagnosis = diagnose(FakeRig({2: 25.0}, loop=lambda c, t: None if c else 9.0))
    assert names(diagnosis.causes) == ["cause 2"]
    assert diagnosis.causes[0].probability < 0.51
    assert diagnosis.verdict == "partly_explained"
    assert diagnosis.notes == (
        "Cause 2 (robot 1): cannot be simulated with the recorded commands, which speaks against it.",
    )


def test_every_trial_is_simulated_with_what_the_others_say():
    """The cause is there in the third trial only half as much: that trial's own prediction does not know."""
    rig = FakeRig({2: 25.0}, loop=lambda c, t: 1.1 if c else 9.0)
    diagnose(rig)
    with_cause = {trial: values[0][0] for trial, causes, values in rig.calls if causes == ("cause 2",)}
    whole = explain(search(rig)).found[0].values[0]
    assert len({round(v, 6) for v in with_cause.values()}) == 4
    for t, value in with_cause.items():
        rest = FakeRig({2: 25.0})
        rest.data = [d for k, d in enumerate(rest.data) if k != t]
        rest.columns_of = {key: [c for k, c in enumerate(v) if k != t] for key, v in rest.columns_of.items()}
        rest.trials = tuple(n for k, n in enumerate(rest.trials) if k != t)
        # Alone in the model: no other cause within its tolerance shares the work.
        problem = Problem.of(rest.rows(rest.candidates()), rest.candidates())
        assert value == pytest.approx(
            Fit.of(problem, [2], background=False).part(2)[0][0], rel=2e-3
        )  # powers are of all trials
        assert value == pytest.approx(whole, rel=0.1)
