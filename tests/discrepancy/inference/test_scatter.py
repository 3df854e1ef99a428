"""What is said to scatter."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from discrepancy import rules
from discrepancy.candidate import Parameter
from discrepancy.engine.explanation import explain, scatter_of
from discrepancy.engine.held_out import foretold
from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.inference.search import Searched
from discrepancy.least_squares.problem import Problem
from linear_problem import CANDIDATES, brute, random_rows


@pytest.mark.parametrize("shown", [True, False])
def test_a_number_that_no_column_shows_is_not_said_to_scatter(shown):
    rng = np.random.default_rng(8)
    pair = (Parameter("first_m", 1e-3, 1e-3), Parameter("second_m", 1e-3, 1e-3))
    places = [replace(CANDIDATES[0], robot=k, joint=None, parameters=pair) for k in (1, 2, 3, 4)]
    rows = []
    for trial in random_rows(rng, n=60):
        causes = [rng.standard_normal((*trial.residual.shape, 2)) for _ in places]
        residual = trial.residual + sum(30e-3 * (-1) ** k * x[..., 0] for k, x in enumerate(causes)) * 1e3
        for x in causes:
            x[..., 1] *= shown
        rows.append(replace(trial, residual=residual, causes=[1e3 * x for x in causes]))
    hypothesis = Hypothesis.of(Problem.of(rows, places), ())
    (scatter,) = scatter_of(hypothesis)
    assert scatter.factor > rules.SCATTER_FACTOR
    names = [p.name for p in scatter.candidate.parameters]
    assert names == (["first_m", "second_m"] if shown else ["first_m"])


def off_everywhere(rng, times=30.0):
    """Four places of one kind that are all off, and one event besides; three trials."""
    places = [replace(CANDIDATES[0], robot=k, joint=None) for k in (1, 2, 3, 4)] + [CANDIDATES[2]]
    rows = []
    for trial in random_rows(rng, candidates=tuple(places)):
        off = [times * 0.5 * (-1) ** k * x[..., 0] for k, x in enumerate(trial.causes[:4])]
        rows.append(replace(trial, residual=trial.residual + sum(off) + trial.causes[4][..., 0]))
    return rows, places


def test_what_knowing_the_machine_is_worth_is_that_of_trials_left_out():
    """Against one dense least squares of the other trials, and the trial's own unknowns fitted to what it leaves."""
    rows, places = off_everywhere(np.random.default_rng(21))
    problem, event = Problem.of(rows, places), [4]
    expected = np.zeros(2)
    for t, row in enumerate(rows):
        for k, background in enumerate((False, True)):
            others = [s for s in range(3) if s != t]
            found = brute(rows, places, event, others, background)
            left = row.residual - row.shared @ found.shared
            for index, values in found.causes.items():
                left = left - row.causes[index] @ (places[index].units * np.array(values))
            own, left = row.local.reshape(left.size, -1), left.ravel()
            expected[k] += np.sum((left - own @ np.linalg.lstsq(own, left, rcond=None)[0]) ** 2)
    told = foretold(problem, event)
    assert told is not None
    np.testing.assert_allclose((told.as_designed, told.as_found), expected / problem.samples, rtol=1e-8)
    assert told.as_found < 2.0 < 50.0 < told.as_designed


def test_kinds_that_scatter_foretell_with_the_spread_that_was_learnt():
    """Against one dense least squares whose tolerances are as wide; they had been held to those given."""
    rows, places = off_everywhere(np.random.default_rng(23), times=10.0)
    places = places[:4]
    rows = [
        replace(row, residual=row.residual - row.causes[4][..., 0], causes=row.causes[:4]) for row in rows
    ]
    best = Hypothesis.of(Problem.of(rows, places), ())
    spread = best.problem.spread
    assert spread[0] > rules.SCATTER_FACTOR
    rig = SimpleNamespace(local_unknowns=rows[0].local.shape[2])
    told = explain(Searched(rig, best, best, ())).foretold
    expected = 0.0
    for t, row in enumerate(rows):
        found = brute(rows, places, [], [s for s in range(3) if s != t], spread=spread)
        left = row.residual - row.shared @ found.shared
        for index, values in found.causes.items():
            left = left - row.causes[index] @ (places[index].units * np.array(values))
        own, left = row.local.reshape(left.size, -1), left.ravel()
        expected += np.sum((left - own @ np.linalg.lstsq(own, left, rcond=None)[0]) ** 2)
    assert told is not None
    assert told.as_found == pytest.approx(expected / best.problem.samples, rel=1e-8)


def test_one_trial_foretells_nothing():
    rows, places = off_everywhere(np.random.default_rng(22))
    assert foretold(Problem.of(rows[:1], places), []) is None
