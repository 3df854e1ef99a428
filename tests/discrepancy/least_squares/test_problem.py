"""The diagnosis' linear problem against one plain least squares, and its evidence against clean draws."""

import numpy as np
import pytest
from scipy.stats import chi2, kstest, ncx2

from discrepancy.least_squares.fit import Fit
from discrepancy.least_squares.problem import Problem
from discrepancy.rig import Transient
from linear_problem import CANDIDATES, brute, candidate, noise_covariance, random_rows, with_residuals


@pytest.fixture
def rng():
    return np.random.default_rng(20260)


@pytest.fixture
def rows(rng):
    return random_rows(rng)


def same_fit(fit, expected):
    assert fit.misfit == pytest.approx(expected.misfit, rel=1e-9)
    np.testing.assert_allclose(fit.coefficients[: fit.problem.shared], expected.shared, rtol=1e-7, atol=1e-10)
    for index, values in expected.causes.items():
        np.testing.assert_allclose(fit.part(index)[0], values, rtol=1e-7, atol=1e-10)


def same_problem(a, b):
    np.testing.assert_allclose(a.grams, b.grams, rtol=1e-9, atol=1e-9)
    for x, y in zip(a.cell_grams, b.cell_grams, strict=True):
        np.testing.assert_allclose(x, y, rtol=1e-9, atol=1e-9)
    for x, y in zip(a.spectra + a.raw + a.local, b.spectra + b.raw + b.local, strict=True):
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


def drawn_noise(rng, problem):
    """Another power in every cell, another spread of every column with a tolerance."""
    power = [rng.uniform(0.5, 4.0, len(p)) for p in problem.power]
    return problem.with_noise(
        power, np.where(problem.tolerant, rng.uniform(1.0, 5.0, problem.spread.shape), 1.0)
    )


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
        A = problem.raw[t][..., keep].reshape(r.residual.size, -1)
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
def test_evidence_is_the_fall_of_the_misfit_without_the_prior(rows, free):
    fit = Fit.of(Problem.of(rows, CANDIDATES), free)
    found = {e.index: e for e in fit.evidence()}
    assert set(found) == set(range(len(CANDIDATES))) - set(free)
    start = brute(rows, CANDIDATES, free).misfit
    for index, evidence in found.items():
        freed = brute(rows, CANDIDATES, [*free, index])
        assert evidence.gain == pytest.approx(start - freed.misfit, rel=1e-6, abs=1e-9)
        np.testing.assert_allclose(evidence.values, freed.causes[index], rtol=1e-6)
        k = len(CANDIDATES[index].parameters)
        assert evidence.parameters == k
        assert evidence.log10_p == pytest.approx(np.log10(chi2.sf(evidence.gain, k)))
        size = sum(r.residual.size for r in rows)
        assert evidence.score == pytest.approx(evidence.gain - 1.6 * k * np.log(size))


def test_evidence_is_the_distance_over_uncertainty_and_tolerance(rows):
    problem = Problem.of(rows, CANDIDATES)
    for index in (0, 1, 3):
        values, covariance = Fit.of(problem, [index]).part(index)
        evidence = Fit.of(problem).evidence_of(index)
        distance = values @ np.linalg.solve(covariance + np.eye(len(values)), values)
        assert evidence.gain == pytest.approx(distance, rel=1e-6)
        np.testing.assert_allclose(evidence.covariance, covariance, rtol=1e-6, atol=1e-12)
    assert Fit.of(problem, [1]).evidence_of(1) is None


@pytest.mark.parametrize("free", [(), (0,), (4,)])
@pytest.mark.parametrize("index", [1, 2, 3])
def test_evidence_with_other_columns_is_that_of_the_changed_problem(rng, rows, free, index):
    problem = Problem.of(rows, CANDIDATES)
    columns = [rng.standard_normal((*r.residual.shape, len(CANDIDATES[index].parameters))) for r in rows]
    columns[1][:] = 0.0  # as of a transient that another trial has
    without = Fit.of(problem, free, fixed=(index, np.zeros(len(CANDIDATES[index].parameters))))
    changed = problem.with_columns(index, CANDIDATES[index], columns)
    expected, found = Fit.of(changed, free).evidence_of(index), without.evidence_with(index, columns)
    for name in ("gain", "fall", "log10_p", "score", "parameters"):
        assert getattr(found, name) == pytest.approx(getattr(expected, name)), name
    np.testing.assert_allclose(found.values, expected.values)
    np.testing.assert_allclose(found.covariance, expected.covariance, atol=1e-12)
    assert found.fall == pytest.approx(without.misfit - Fit.of(changed, [*free, index]).misfit)


def test_inflated_noise_divides_the_gain(rows):
    fit = Fit.of(Problem.of(rows, CANDIDATES))
    plain, inflated = fit.evidence_of(1), fit.evidence_of(1, 4.0)
    assert inflated.gain == pytest.approx(plain.gain / 4.0)
    assert inflated.log10_p == pytest.approx(np.log10(chi2.sf(plain.gain / 4.0, 2)))
    scores = [e.score for e in fit.evidence(4.0)]
    assert scores == sorted(scores, reverse=True)


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


def test_undecidable_directions_are_left_out(rows):
    """One parameter in the span of the unknowns, one nearly without effect: neither counts."""
    group = candidate("two", (0.3, 1.0), (0.3, 1.0))
    hidden, event = candidate("hidden", (0.3, 1.0)), candidate("event", (0.0, 1.0))
    spoiled = []
    for r in rows:
        shadow = r.shared @ np.array([[1.0], [-2.0]])
        half = np.concatenate([r.causes[0], shadow], axis=2)
        weak = 1e-5 * r.causes[1][..., :1]
        spoiled.append(_with_causes(r, [half, r.local[..., :1], shadow, weak]))
    candidates = (group, hidden, event, candidate("weak", (0.3, 1.0)))
    fit = Fit.of(Problem.of(spoiled, candidates))
    assert [e.index for e in fit.evidence()] == [0]
    only = fit.evidence_of(0)
    assert only.parameters == 1
    alone = [_with_causes(r, [r.causes[0]]) for r in spoiled]
    single = Problem.of(
        [_with_causes(r, [r.causes[0][..., :1]]) for r in alone], (candidate("x", (0.3, 1.0)),)
    )
    assert only.gain == pytest.approx(Fit.of(single).evidence_of(0).gain, rel=1e-6)
    limits = fit.limits(38.0)
    assert np.isfinite(limits[0][0])
    assert limits[0][0] < 10.0
    for index in (1, 2, 3):
        assert np.all(limits[index] > 1e100)


def draws(rows, problem, rng, count, fits):
    """Clean draws: noise, tolerances, any values of the unknowns; gains of the candidates by ``fits``."""
    tolerances = problem.tolerant.astype(float)
    for _ in range(count):
        values = rng.standard_normal(len(tolerances)) * tolerances
        unknowns = rng.uniform(-50.0, 50.0, problem.shared)
        residuals = []
        for t, row in enumerate(rows):
            x = rng.standard_normal(row.residual.shape)
            x += problem.raw[t][..., :-1] @ np.append(unknowns, values)
            x += row.local @ rng.uniform(-50.0, 50.0, row.local.shape[2])
            residuals.append(x)
        fits(Fit.of(problem.with_residual(residuals)))


def test_gain_on_clean_draws_is_chi_square_distributed(rng):
    # Weak columns: tolerance and uncertainty are of one size, so both matter.
    rows = random_rows(rng, trials=2, n=12)
    problem = Problem.of(rows, CANDIDATES)
    information = np.diag(Fit.of(problem).covariance)[2:5]
    assert np.all((information > 0.001) & (information < 0.999))
    gains = []
    draws(rows, problem, rng, 1200, lambda fit: gains.append([fit.evidence_of(i).gain for i in range(5)]))
    for index, sample in enumerate(np.array(gains).T):
        k = len(CANDIDATES[index].parameters)
        assert sample.mean() == pytest.approx(k, abs=4.0 * np.sqrt(2.0 * k / len(sample)))
        assert kstest(sample, chi2(k).cdf).pvalue > 0.005


def test_limits_are_found_nine_times_in_ten(rng):
    rows = random_rows(rng, trials=2, n=12)
    problem = Problem.of(rows, CANDIDATES)
    limits = Fit.of(problem).limits(38.0)
    assert 1.0 - ncx2.cdf(24.0, 1, 38.0) == pytest.approx(0.9, abs=0.01)
    for index, parameter in ((0, 0), (1, 1), (2, 0), (4, 1)):
        k = len(CANDIDATES[index].parameters)
        expected = 1.0 - ncx2.cdf(24.0, k, 38.0)
        push = np.zeros(k)
        push[parameter] = limits[index][parameter]
        moved = [_gain_with(rows, problem, rng, index, push) for _ in range(300)]
        assert np.mean(np.array(moved) > 24.0) == pytest.approx(expected, abs=0.05)


def _gain_with(rows, problem, rng, index, values):
    residuals = []
    tolerated = rng.standard_normal(len(problem.tolerant)) * problem.tolerant
    for t, row in enumerate(rows):
        x = rng.standard_normal(row.residual.shape) + row.causes[index] @ values
        residuals.append(x + problem.raw[t][..., problem.shared : -1] @ tolerated)
    return Fit.of(problem.with_residual(residuals)).evidence_of(index).gain


def test_strain_of_the_tolerances_by_hand(rows):
    fit = Fit.of(Problem.of(rows, CANDIDATES), [0])
    expected = brute(rows, CANDIDATES, [0])
    values = np.concatenate([expected.causes[1], expected.causes[3]])
    value, freedom, log10_p = fit.strain
    assert value == pytest.approx(np.sum(values**2))
    used = np.concatenate([np.diag(fit.part(k)[1]) for k in (1, 3)])
    assert freedom == pytest.approx(np.sum(1.0 - used))
    assert log10_p == pytest.approx(np.log10(chi2.sf(value, freedom)))


def test_strain_is_nothing_special_on_clean_draws(rng):
    rows = random_rows(rng, trials=2, n=40)
    problem, found = Problem.of(rows, CANDIDATES), []
    draws(rows, problem, rng, 300, lambda fit: found.append(fit.strain))
    found = np.array(found)
    # A tolerance that the data hardly see is estimated as smaller than it is: at most its freedom.
    assert found[:, 0].mean() == pytest.approx(found[0, 1], rel=0.1)
    assert np.mean(found[:, 2] < -2.0) < 0.04
