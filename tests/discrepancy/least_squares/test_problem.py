"""The diagnosis' linear problem against one plain least squares."""

import numpy as np
import pytest

from discrepancy.candidate import Transient
from discrepancy.least_squares.fit import Fit
from discrepancy.least_squares.gram import flat_inverse
from discrepancy.least_squares.problem import Problem
from linear_problem import (
    CANDIDATES,
    brute,
    candidate,
    drawn_noise,
    noise_covariance,
    random_rows,
    with_residuals,
)


@pytest.fixture
def rng():
    return np.random.default_rng(20260)


@pytest.fixture
def rows(rng):
    return random_rows(rng)


ALL = slice(None)


def same_fit(fit, expected):
    assert fit.misfit == pytest.approx(expected.misfit, rel=1e-9)
    np.testing.assert_allclose(fit.coefficients[: fit.problem.shared], expected.shared, rtol=1e-7, atol=1e-10)
    for index, values in expected.causes.items():
        np.testing.assert_allclose(fit.part(index)[0], values, rtol=1e-7, atol=1e-10)


def same_problem(a, b):
    np.testing.assert_allclose(a.grams, b.grams, rtol=1e-9, atol=1e-9)
    for x, y in zip(a.cell_grams, b.cell_grams, strict=True):
        for cell in range(x.cells):
            np.testing.assert_allclose(x.whole(cell), y.whole(cell), rtol=1e-9, atol=1e-9)
    for t in a.trials:
        pairs = zip(*((p.spectra_of(t, ALL), p.raw_columns(t, ALL), p.local[t]) for p in (a, b)), strict=True)
        for x, y in pairs:
            np.testing.assert_allclose(x, y, rtol=1e-9, atol=1e-10)
    assert a.spans == b.spans
    assert a.shared == b.shared
    np.testing.assert_array_equal(a.tolerant, b.tolerant)
    assert a.candidates == b.candidates


@pytest.mark.parametrize("free", [(), (0,), (2,), (1, 4), (3, 0, 2)])
@pytest.mark.parametrize("background", [True, False])
@pytest.mark.parametrize("trials", [None, [1], [2, 0]])
def test_solution_is_that_of_augmented_least_squares(rows, free, background, trials):
    fit = Fit.of(Problem.of(rows, CANDIDATES), free, trials, background=background)
    same_fit(fit, brute(rows, CANDIDATES, free, trials, background))


def test_covariance_is_the_inverse_of_the_augmented_normal_matrix(rng):
    rows = random_rows(rng, local=0)
    fit = Fit.of(Problem.of(rows, CANDIDATES), [2])
    columns = []
    for r in rows:
        units = [c.units for c in CANDIDATES[:4]]
        parts = [r.shared, *(a * u for a, u in zip(r.causes, units, strict=False))]
        columns.append(np.concatenate(parts, axis=2).reshape(r.residual.size, -1))
    A = np.concatenate(columns)
    prior = np.diag([0.0, 0.0, 1.0, 1.0, 1.0, 0.0, 1.0, 1.0, 1.0])
    np.testing.assert_allclose(fit.covariance, np.linalg.inv(A.T @ A + prior), rtol=1e-8, atol=1e-14)
    np.testing.assert_allclose(fit.part(2)[1], fit.covariance[5:6, 5:6])


def test_what_a_solution_leaves_and_its_local_unknowns(rows):
    problem = Problem.of(rows, CANDIDATES)
    fit, expected = Fit.of(problem, [1]), brute(rows, CANDIDATES, [1])
    for t, row in enumerate(rows):
        np.testing.assert_allclose(fit.local(t), expected.local[t], rtol=1e-7)
        assert np.sum(fit.remaining(t) ** 2) == pytest.approx(expected.data_misfit[t])
        assert fit.held_out(t) == pytest.approx(expected.data_misfit[t])
        left = row.residual - row.shared @ expected.shared - row.local @ expected.local[t]
        for index, values in expected.causes.items():
            left = left - row.causes[index] @ (CANDIDATES[index].units * values)
        np.testing.assert_allclose(fit.remaining(t), left, atol=1e-9)


def test_held_out_trial_fits_its_own_unknowns_and_nothing_else(rows):
    fit = Fit.of(Problem.of(rows, CANDIDATES), [2], [0, 1])
    expected = brute(rows, CANDIDATES, [2], [0, 1])
    left = rows[2].residual - rows[2].shared @ expected.shared
    for index, values in expected.causes.items():
        left = left - rows[2].causes[index] @ (CANDIDATES[index].units * values)
    own = rows[2].local.reshape(-1, 2)
    x = np.linalg.lstsq(own, left.ravel(), rcond=None)[0]
    assert fit.held_out(2) == pytest.approx(np.sum((left.ravel() - own @ x) ** 2))


def test_fixed_values_take_a_candidate_out_of_the_fit(rows):
    problem, values = Problem.of(rows, CANDIDATES), np.array([0.7, -1.3])
    for trials in (None, [1]):
        same_fit(
            Fit.of(problem, [0], trials, fixed=(1, values)),
            brute(rows, CANDIDATES, [0], trials, fixed=(1, values)),
        )
    # Held at the values that the fit itself chooses, it changes nothing.
    best = Fit.of(problem, [4], background=False)
    held = Fit.of(problem, [], fixed=(4, best.part(4)[0]), background=False)
    assert held.misfit == pytest.approx(best.misfit)


@pytest.mark.parametrize("free", [(), (1,), (3, 2)])
@pytest.mark.parametrize("trials", [None, [2, 0]])
def test_powers_and_spreads_are_those_of_generalised_least_squares(rng, free, trials):
    """Noise that is neither white nor of one size, two rows that stand alone, two groups of channels."""
    rows = random_rows(rng, n=22, local=0, moving=20, groups=[0, 0, 1])
    problem = drawn_noise(rng, Problem.of(rows, CANDIDATES))
    noise = [
        noise_covariance(r, p[c.index]) for r, p, c in zip(rows, problem.power, problem.cells, strict=True)
    ]
    expected = brute(rows, CANDIDATES, free, trials, noise=noise, spread=problem.spread)
    same_fit(Fit.of(problem, free, trials), expected)


def test_covariance_with_powers_and_spreads(rng):
    rows = random_rows(rng, n=22, local=0, moving=20, groups=[0, 0, 1])
    problem = drawn_noise(rng, Problem.of(rows, CANDIDATES))
    fit, H = Fit.of(problem, [1]), np.diag([0.0, 0.0, *problem.spread**-2.0])
    H[3:5, 3:5] = 0.0
    keep = np.r_[:5, 6:9]
    H = H[np.ix_([*range(5), 6, 7, 8], [*range(5), 6, 7, 8])]
    for t, r in enumerate(rows):
        A = problem.raw_columns(t, slice(None))[..., keep].reshape(r.residual.size, -1)
        H += A.T @ np.linalg.solve(noise_covariance(r, problem.power[t][problem.cells[t].index]), A)
    np.testing.assert_allclose(fit.covariance, np.linalg.inv(H), rtol=1e-7, atol=1e-12)


def test_further_columns_are_weighed_as_those_of_the_problem(rng, rows):
    """What a candidate's own columns tell beside all else, with powers and spreads, equals what the problem says."""
    problem = drawn_noise(rng, Problem.of(rows, CANDIDATES))
    fit = Fit.of(problem, [0])
    own = [r.causes[2] * CANDIDATES[2].units for r in rows]
    for got, expected in zip(fit.told_by(own), fit.told(2), strict=True):
        np.testing.assert_allclose(got, expected, rtol=1e-8)


def test_tolerance_that_is_known_tells_nothing_of_itself(rng, rows):
    """Information without the prior is the same whatever the prior's spread, if all else stays."""
    problem = Problem.of(rows, CANDIDATES)
    wide = problem.spread.copy()
    wide[problem.columns_of(1)] = 7.0
    for got, expected in zip(
        Fit.of(problem.with_noise(problem.power, wide)).told(1), Fit.of(problem).told(1), strict=True
    ):
        np.testing.assert_allclose(got, expected, rtol=1e-7)


def test_chi2_is_of_the_noise_as_whitened(rng):
    """Whatever powers the fit used: squares of what it leaves, and of the tolerances in their spreads."""
    rows = random_rows(rng, n=22, local=0)
    problem = drawn_noise(rng, Problem.of(rows, CANDIDATES))
    fit = Fit.of(problem, [2])
    left = sum(float(np.sum(fit.remaining(t) ** 2)) for t in problem.trials)
    values = np.concatenate([fit.part(i)[0] / problem.spread[problem.columns_of(i)] for i in (0, 1, 3)])
    assert fit.chi2 == pytest.approx(left + np.sum(values**2))


@pytest.mark.parametrize("free", [(), (0,), (4,)])
def test_what_the_data_tell_of_a_candidate_is_how_the_misfit_falls(rows, free):
    """Free in place of held at nought, by two least squares; where the fall is least, and how it is curved there."""
    fit = Fit.of(Problem.of(rows, CANDIDATES), free)
    for index in set(range(len(CANDIDATES))) - set(free):
        information, score = fit.told(index)
        values = np.linalg.solve(information, score)
        freed, k = brute(rows, CANDIDATES, [*free, index]), len(values)
        np.testing.assert_allclose(values, freed.causes[index], rtol=1e-6)
        held = brute(rows, CANDIDATES, free, fixed=(index, np.zeros(k)))
        assert score @ values == pytest.approx(held.misfit - freed.misfit, rel=1e-6)
        away = brute(rows, CANDIDATES, free, fixed=(index, values + 0.3))
        step = 0.3 * np.ones(k)
        assert step @ information @ step == pytest.approx(away.misfit - freed.misfit, rel=1e-6)


def test_changing_a_problem_equals_building_it_anew(rng, rows):
    problem = Problem.of(rows, CANDIDATES)
    residuals = [rng.standard_normal(r.residual.shape) for r in rows]
    same_problem(problem.with_residual(residuals), Problem.of(with_residuals(rows, residuals), CANDIDATES))

    other = candidate("two", (0.7, 9.0), (0.0, 3.0))
    columns = [rng.standard_normal((*r.residual.shape, 2)) for r in rows]
    rebuilt = [_with_causes(r, [*r.causes[:1], c, *r.causes[2:]]) for r, c in zip(rows, columns, strict=True)]
    swapped = (CANDIDATES[0], candidate("two", (0.2, 1.0), (0.5, 1.0)), *CANDIDATES[2:])
    same_problem(problem.with_columns(1, swapped[1], columns), Problem.of(rebuilt, swapped))

    added = [_with_causes(r, [*r.causes, c]) for r, c in zip(rows, columns, strict=True)]
    same_problem(problem.extended(other, columns), Problem.of(added, (*CANDIDATES, other)))


def _with_causes(row, causes):
    return type(row)(row.name, row.residual, row.local, row.shared, causes, row.time)


def _with_local(row, local):
    return type(row)(row.name, row.residual, local, row.shared, row.causes, row.time)


def test_problem_without_candidates_can_be_extended(rng):
    rows = random_rows(rng, candidates=())
    column = [rng.standard_normal((*r.residual.shape, 1)) for r in rows]
    added = [_with_causes(r, [c]) for r, c in zip(rows, column, strict=True)]
    same_problem(Problem.of(rows, ()).extended(CANDIDATES[2], column), Problem.of(added, CANDIDATES[2:3]))


def test_trials_without_own_unknowns_and_with_dependent_ones(rng):
    rows = random_rows(rng, local=0)
    same_fit(Fit.of(Problem.of(rows, CANDIDATES), [2]), brute(rows, CANDIDATES, [2]))
    twice = [_with_local(r, np.repeat(r.shared[..., :1] * 3.0 + 1.0, 2, axis=2)) for r in rows]
    same_fit(Fit.of(Problem.of(twice, CANDIDATES), [2]), brute(twice, CANDIDATES, [2]))


def test_values_of_no_own_unknowns(rng):
    """A single robot's trials have none."""
    assert Fit.of(Problem.of(random_rows(rng, local=0), CANDIDATES)).local(0).shape == (0,)


def test_index_tells_places_and_intervals_apart(rows):
    pushes = [candidate("push", (0.0, 1.0), transient=Transient(0, s, 1.0)) for s in (1.0, 2.0)]
    problem = Problem.of(rows, CANDIDATES)
    for push in pushes:
        columns = [np.ones((*r.residual.shape, 1)) for r in rows]
        problem = problem.extended(push, columns)
    assert [problem.index_of(p) for p in pushes] == [5, 6]
    assert problem.index_of(CANDIDATES[3]) == 3
    assert problem.index_of(candidate("other", (0.1, 1.0))) is None


def test_what_the_unknowns_can_do_tells_nothing(rows):
    """A parameter in the span of shared unknowns, one in that of the trial's own."""
    hidden, own = candidate("hidden", (0.3, 1.0)), candidate("event", (0.0, 1.0))
    spoiled = [_with_causes(r, [r.shared @ np.array([[1.0], [-2.0]]), r.local[..., :1]]) for r in rows]
    fit = Fit.of(Problem.of(spoiled, (hidden, own)))
    for index in (0, 1):
        information, score = fit.told(index)
        np.testing.assert_allclose(information, 0.0, atol=1e-8)
        np.testing.assert_allclose(score, 0.0, atol=1e-8)


def test_a_column_of_nothing_stays_nothing(rng):
    """Rounding in its place is not made huge: nor by a value, nor by a covariance."""
    for size in (3, 40):
        root = rng.standard_normal((size, size))
        H = root @ root.T
        H[1], H[:, 1] = 0.0, 0.0
        inverse = flat_inverse(H)
        others = np.delete(np.arange(size), 1)
        assert not inverse[1].any()
        assert not inverse[:, 1].any()
        np.testing.assert_allclose(
            inverse[np.ix_(others, others)] @ H[np.ix_(others, others)], np.eye(size - 1), atol=1e-6
        )
