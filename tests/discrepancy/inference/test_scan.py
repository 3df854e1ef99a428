"""The first judgement of candidates, against dense normal densities."""

import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from scipy.stats import multivariate_normal

from dense_evidence import dense_evidence
from discrepancy import rules
from discrepancy.candidate import Transient
from discrepancy.inference.prior import log_prior_odds
from discrepancy.inference.scan import log_bayes_factor, scan, score_of, score_with
from discrepancy.least_squares.fit import Fit
from discrepancy.least_squares.problem import Problem
from linear_problem import CANDIDATES, candidate, random_rows, with_residuals


@pytest.fixture
def rng():
    return np.random.default_rng(12)


def density(y, A, spread):
    return multivariate_normal.logpdf(y, np.zeros(len(y)), np.eye(len(y)) + spread**2 * A @ A.T)


@pytest.mark.parametrize("k", [1, 3])
@pytest.mark.parametrize(("size", "spike"), [(0.0, 1.0), (3.0, 1.0), (30.0, 1.0), (2.0, 0.0), (40.0, 5.0)])
def test_bayes_factor_is_that_of_dense_densities(rng, k, size, spike):
    A = rng.standard_normal((30, k))
    y = rng.standard_normal(30) + A @ (size * np.ones(k))
    got = log_bayes_factor(A.T @ A, A.T @ y, spike)
    least = rules.LEAST_SLAB * spike
    found = minimize_scalar(
        lambda s: -density(y, A, max(np.exp(s), least)), bounds=(-5.0, 6.0), method="bounded"
    )
    expected = -found.fun - density(y, A, spike)
    assert expected - 0.25 * k < got < expected + 1e-5


def test_healthy_ones_are_judged_by_the_least_slab(rng):
    """To the last digit, as no other slab is likelier."""
    A = rng.standard_normal((30, 2))
    y = rng.standard_normal(30) + A @ np.array([1.0, -1.0])
    expected = density(y, A, rules.LEAST_SLAB * 2.0) - density(y, A, 2.0)
    assert log_bayes_factor(A.T @ A, A.T @ y, 2.0) == pytest.approx(expected, abs=1e-6)
    assert expected < 0


def test_what_the_data_cannot_see_is_not_there():
    assert log_bayes_factor(1e-5 * np.eye(2), np.array([1e-3, 0.0]), 1.0) == -np.inf


def test_score_is_evidence_at_the_same_powers_and_spreads(rng):
    """Prior odds on top. Its slab is one of five, near the best of all where the data see all numbers alike."""
    rows = random_rows(rng, n=16, local=0)
    rows = with_residuals(rows, [r.residual + r.causes[1] @ np.array([2.0, -30.0]) for r in rows])
    problem = Problem.of(rows, CANDIDATES)
    power = [rng.uniform(0.5, 2.0, len(p)) for p in problem.power]
    problem = problem.with_noise(power, np.where(problem.tolerant, 1.5, 1.0))
    fit = Fit.of(problem)
    for index in range(len(CANDIDATES)):
        healthy = dense_evidence(rows, problem, ())
        least = rules.LEAST_SLAB * 1.5 if problem.has_tolerance(index) else 0.0

        def there(log_slab, index=index, least=least):
            spread = problem.spread.copy()
            spread[problem.columns_of(index)] = max(np.exp(log_slab), least)
            return -dense_evidence(rows, problem, [index], spread=spread)

        grid = min(there(x) for x in np.linspace(-4.0, 5.0, 19))
        odds = np.log(rules.PRIOR_ODDS / rules.SLAB_OCTAVES)  # one place of every cause
        expected = -grid - healthy + odds
        k = len(CANDIDATES[index].parameters)
        assert expected - 0.6 * k < score_of(fit, index) < expected + 0.1
    best = scan(fit)[0]
    assert best.index == 1
    assert best.score > 50.0
    assert 1 not in [item.index for item in scan(Fit.of(problem, [1]))]


def test_columns_that_are_not_the_problems_are_judged_alike(rng):
    """A candidate without a tolerance, by its columns and as one of the problem."""
    rows = random_rows(rng)
    fit = Fit.of(Problem.of(rows, CANDIDATES))
    own = [r.causes[2] for r in rows]
    assert score_with(fit, CANDIDATES[2], own) == pytest.approx(score_of(fit, 2), abs=1e-9)


def test_prior_odds_are_shared_by_places_and_intervals(rng):
    def at(joint, transient=None):
        one = candidate("one", (0.5, 9.0), transient=transient)
        return type(one)("one", "one", 1, joint, one.parameters, {}, transient)

    several = (at(1), at(2), at(3), candidate("two", (0.5, 1.0)), at(None, Transient(0, 1.0, 2.0)))
    problem = Problem.of(random_rows(rng, candidates=several), several)
    once = rules.PRIOR_ODDS / rules.SLAB_OCTAVES
    odds = [np.exp(log_prior_odds(problem, c)) for c in several]
    np.testing.assert_allclose(odds, [once / 3] * 3 + [once, once / rules.INTERVALS])
