"""What is said to scatter."""

from dataclasses import replace

import numpy as np
import pytest

from discrepancy import rules
from discrepancy.candidate import Parameter
from discrepancy.engine.explanation import scatter_of
from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.least_squares.problem import Problem
from linear_problem import CANDIDATES, random_rows


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
