"""What is kept of columns that are asked about again is what they were told the first time."""

import gc

import numpy as np
import pytest

from discrepancy import rules
from discrepancy.least_squares.asked import OfArrays
from discrepancy.least_squares.fit import Fit
from discrepancy.least_squares.problem import Problem
from linear_problem import CANDIDATES, candidate, drawn_noise, random_rows

UNITS = np.array([0.5, 3.0])


@pytest.fixture
def rng():
    return np.random.default_rng(77)


@pytest.fixture
def rows(rng):
    return random_rows(rng)


@pytest.fixture(autouse=True, params=[1, 1000], ids=["all kept", "only themselves kept"])
def columns_kept(request, monkeypatch):
    """Products with pieces of how many columns are kept."""
    monkeypatch.setattr(rules, "KEPT_COLUMNS", request.param)


def asked_about(rng, rows, count=2):
    return [rng.standard_normal((*r.residual.shape, count)) for r in rows]


def same(got, expected):
    for a, b in zip(got, expected, strict=True):
        for x, y in zip(a, b, strict=True):
            np.testing.assert_allclose(x, y, rtol=1e-9, atol=1e-9)


def test_told_as_often_as_one_likes(rng, rows):
    """By other fits and beside other columns, too; copies are told as if they had never been asked about."""
    problem, columns = Problem.of(rows, CANDIDATES), asked_about(rng, rows)
    other = columns[:1] + [np.zeros_like(c) for c in columns[1:]]
    for _ in range(rules.ASKED_BEFORE + 2):
        problem = drawn_noise(rng, problem)
        fit = Fit.of(problem, [2])
        fresh = [[c.copy() for c in each] for each in (columns, other)]
        same(fit.told_by_each([columns, other], [UNITS, UNITS]), fit.told_by_each(fresh, [UNITS, UNITS]))
    assert problem.again[0].kept == 1  # the same array in both
    assert problem.again[1].kept == 1  # and nought is nothing to keep


def test_told_beside_other_columns(rng, rows):
    """Once a candidate has other columns, in one piece with others before, and another is there besides."""
    problem, columns = Problem.of(rows, CANDIDATES), asked_about(rng, rows)
    for k in range(rules.ASKED_BEFORE + 2):
        changed = problem.with_columns(
            1, CANDIDATES[1], [rng.standard_normal(r.causes[1].shape) for r in rows]
        )
        changed = changed.extended(candidate(f"more {k}", (1.0, 1.0)), asked_about(rng, rows, 1))
        fit = Fit.of(changed, [1])
        same([fit.told_by(columns)], [fit.told_by([c.copy() for c in columns])])
    assert problem.again[0].kept == 1


def test_nothing_is_kept_of_columns_that_are_gone(rng, rows):
    problem, columns = Problem.of(rows, CANDIDATES), asked_about(rng, rows)
    for _ in range(rules.ASKED_BEFORE + 1):
        Fit.of(problem).told_by(columns)
    assert problem.again[0].kept == 1
    del columns
    gc.collect()
    assert problem.again[0].kept == 0


def test_arrays_of_the_same_numbers_are_two():
    one, two, kept = np.ones(3), np.ones(3), OfArrays[str]()
    kept.keep(one, "one")
    assert kept.get(one) == "one"
    assert kept.get(two) is None
    kept.keep(one, "again")
    assert (kept.get(one), len(kept)) == ("again", 1)
    del one
    assert len(kept) == 0
