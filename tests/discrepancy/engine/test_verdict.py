"""From what a search found to the verdict: shares of the misfit, what counts as clean."""

from dataclasses import replace

import pytest

from discrepancy import rules
from discrepancy.engine.explanation import Scatter, explain
from discrepancy.engine.verdict import verdict_of
from discrepancy.inference.search import search
from discrepancy.least_squares.fit import Fit
from discrepancy.least_squares.problem import Problem
from fake_rig import CATALOGUE, FakeRig


@pytest.fixture(scope="module")
def one():
    return explain(search(FakeRig({2: 25.0})))


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
def test_share_of_the_misfit(one, nominal, plain, expected):
    n = one.samples
    assert replace(one, nominal=nominal * n, plain=plain * n).explained == pytest.approx(expected)


def test_misfits_are_those_of_four_fits(one):
    """Of noise as whitened; what the powers are learnt as moves the tolerances' values by little."""
    rig = FakeRig({2: 25.0})
    problem = Problem.of(rig.rows(rig.candidates()), rig.candidates())
    assert one.nominal == pytest.approx(Fit.of(problem, background=False).misfit)
    assert one.plain == pytest.approx(Fit.of(problem, [2], background=False).misfit)
    assert one.before == pytest.approx(Fit.of(problem).misfit, rel=0.02)
    assert one.after == pytest.approx(Fit.of(problem, [2]).misfit, rel=1e-3)
    assert one.before >= Fit.of(problem).misfit * (1 - 1e-9)  # no other fit leaves less
    assert one.after >= Fit.of(problem, [2]).misfit * (1 - 1e-9)


CLEAN, NOT = rules.CLEAN_CHI2_PER_N, rules.CLEAN_CHI2_PER_N + 0.01


@pytest.mark.parametrize(
    ("after", "unlisted", "causes", "scatters", "expected"),
    [
        (CLEAN, 0.0, 1, False, "explained"),
        (CLEAN, 0.0, 1, True, "explained"),
        (CLEAN, 0.0, 0, False, "consistent"),
        (CLEAN, 0.0, 0, True, "miscalibrated"),
        (NOT, 0.0, 0, False, "unexplained"),
        (NOT, 0.0, 0, True, "unexplained"),
        (NOT, 0.0, 1, False, "partly_explained"),
        (CLEAN, rules.UNLISTED_NATS, 1, False, "partly_explained"),
        (CLEAN, rules.UNLISTED_NATS, 0, False, "unexplained"),
        (CLEAN, rules.UNLISTED_NATS - 0.1, 0, False, "consistent"),
    ],
)
def test_verdict_boundaries(one, after, unlisted, causes, scatters, expected):
    made = replace(
        one,
        after=after * one.samples,
        unlisted_nats=unlisted,
        found=one.found[:causes],
        scatter=(Scatter(CATALOGUE[0], 5.0, 9, 40.0),) if scatters else (),
    )
    assert verdict_of(made) == expected
