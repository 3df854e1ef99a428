"""Named causes and their rivals in a closed loop that is made up: who stays, who goes, who is ambiguous."""

from dataclasses import replace

import numpy as np
import pytest

from discrepancy.engine.confirm import confirm
from discrepancy.engine.diagnose import diagnose
from discrepancy.inference.refit import explanation_of, refit
from discrepancy.inference.search import search
from discrepancy.least_squares.fit import Fit
from discrepancy.least_squares.problem import Problem
from fake_rig import CATALOGUE, TWINS, FakeRig, names


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
        "Cause 2 (robot 1): with it the recorded commands cannot be simulated, so it is not named.",
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
        assert value == pytest.approx(Fit.of(problem, [2], background=False).part(2)[0][0], rel=1e-9)
        assert value == pytest.approx(whole, rel=0.1)


def test_what_a_replaced_cause_left_goes_with_it():
    """The rival responds better; beside it nothing speaks for the second cause, which is not named any more."""
    (found,) = search(FakeRig({2: 25.0}, twins=TWINS)).found
    other = found.rivals[0][0]
    rig = FakeRig({2: 25.0}, twins=TWINS, loop=lambda c, t: 1.1 if other.cause in c else 9.0)
    second = replace(found, index=6, candidate=CATALOGUE[6], rivals=())
    fit = refit(rig, search(rig).problem, [found.index, second.index])
    both = explanation_of(rig, fit, [found, second], [], nominal=1e5, before=1e5)
    confirmed = confirm(rig, both)
    assert names(confirmed.explanation.found) == [other.cause]
    assert [a.candidate.cause for (a,) in confirmed.alternatives] == [found.candidate.cause]
    assert [r.chi2_per_n for r in confirmed.gain.after] == pytest.approx([1.1] * 4)
    assert confirmed.notes[1] == "Cause 6 (robot 1): tells nothing any more beside that, so it is not named."
    assert rig.calls[-1][1] == (other.cause,)  # simulated again without it
