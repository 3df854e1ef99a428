"""From what a search found to the verdict: shares, boundaries, and causes that only add up."""

from dataclasses import replace

import numpy as np
import pytest

from discrepancy.engine.diagnose import diagnose
from discrepancy.engine.verdict import verdict_of
from discrepancy.inference.search import search
from discrepancy.least_squares.fit import Fit
from discrepancy.least_squares.problem import Problem
from discrepancy.rig import Transient
from discrepancy.rules import CLEAN_CHI2_PER_N
from fake_rig import CATALOGUE, FakeRig, names


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
    assert explanation.nominal == pytest.approx(Fit.of(problem, background=False).misfit)
    assert explanation.before == pytest.approx(Fit.of(problem).misfit)
    assert explanation.plain == pytest.approx(Fit.of(problem, [2], background=False).misfit)
    assert explanation.after == pytest.approx(Fit.of(problem, [2]).misfit)


@pytest.mark.parametrize(
    ("nominal", "plain", "after", "causes", "expected"),
    [
        (10.0, 2.0, 1.15, 1, "explained"),  # clean with tolerances
        (5.0, 5.0, 1.15, 0, "consistent"),
        (5.0, 5.0, 1.16, 0, "unexplained"),
        (10.0, 1.2, 1.16, 1, "partly_explained"),  # nearly all of it, but what is left is not clean
        (7350.0, 5.2, 5.16, 1, "partly_explained"),
        (10.0, 7.34, 2.0, 1, "partly_explained"),  # 30 %
        (10.0, 7.35, 2.0, 1, "unexplained"),
    ],
)
def test_verdict_boundaries(nominal, plain, after, causes, expected):
    explanation = search(FakeRig({2: 25.0}))
    n = explanation.samples
    sizes = {"nominal": nominal * n, "plain": plain * n, "after": after * n}
    assert verdict_of(replace(explanation, found=explanation.found[:causes], **sizes)) == expected


def test_three_causes_at_one_robot_only_add_up():
    explanation = search(FakeRig({k: 30.0 for k in (1, 2, 3)}))
    assert len(explanation.found) == 3
    assert explanation.clean
    assert verdict_of(explanation) == "unexplained"
    assert verdict_of(replace(explanation, found=explanation.found[:2])) == "explained"


def test_of_three_at_one_robot_a_transient_goes_first():
    """Two causes at one robot are believed without the push that took what they left."""
    rig = FakeRig({1: 30.0, 2: 30.0}, burst=(1, 0.0, 2))
    push = rig.transients([])[0]
    x, local, shared = rig.data[1]
    rig.data[1] = x + rig.columns(push)[1] @ np.array([3.0, -2.0]), local, shared
    assert sorted(names(search(rig).found)) == ["cause 1", "cause 2", "push"]
    diagnosis = diagnose(rig, closed_loop=False)
    assert sorted(names(diagnosis.causes)) == ["cause 1", "cause 2"]
    assert diagnosis.verdict == "partly_explained"  # what the push took is left
    assert any("takes what the other causes leave" in note for note in diagnosis.notes)


def test_three_causes_at_several_robots_are_believed_if_they_are_of_three_families():
    explanation = search(FakeRig({k: 30.0 for k in (1, 2, 3)}))
    first, *others = explanation.found

    def verdict(*families):
        moved = [
            replace(found, candidate=replace(found.candidate, robot=robot, family=family))
            for robot, (found, family) in enumerate(zip((first, *others), families, strict=True), start=1)
        ]
        return verdict_of(replace(explanation, found=tuple(moved)))

    assert verdict("a", "b", "c") == "explained"
    assert verdict("a", "b", "a") == "unexplained"


def test_strained_tolerances_are_not_clean():
    """Six causes at 3.5 times their tolerance: none stands out, together they are no chance."""
    rig = FakeRig({k: 4.5 for k in range(5)})
    problem = Problem.of(rig.rows(rig.candidates()), rig.candidates())
    explanation = replace(search(FakeRig({})), fit=Fit.of(problem))
    assert explanation.after <= CLEAN_CHI2_PER_N * explanation.samples
    assert not explanation.clean
    assert verdict_of(explanation) == "unexplained"


def test_three_transients_are_not_dropped_into_silence():
    """Only one among lasting causes goes; three events stay a verdict of their own, never ``consistent``."""
    three = [replace(c, transient=Transient(k, 0.0, 1.0)) for k, c in enumerate(CATALOGUE[1:4])]
    rig = FakeRig({k: 30.0 for k in (1, 2, 3)})
    explanation = search(rig)
    assert len(explanation.found) == 3
    found = tuple(replace(f, candidate=c) for f, c in zip(explanation.found, three, strict=True))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            "discrepancy.engine.diagnose.search", lambda *_, **__: replace(explanation, found=found)
        )
        diagnosis = diagnose(rig, closed_loop=False)
    assert diagnosis.verdict == "unexplained"
    assert not any("takes what the other causes leave" in note for note in diagnosis.notes)
