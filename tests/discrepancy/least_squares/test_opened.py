"""Unknowns of a known size, integrated out: the same as a dense covariance of the rows."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from discrepancy.least_squares.fit import Fit
from discrepancy.least_squares.gram import orthonormal
from discrepancy.least_squares.opened import Opened, through
from discrepancy.team.linear.patches import Patches
from discrepancy.least_squares.problem import Problem
from linear_problem import CANDIDATES, brute, random_rows
from test_problem import same_fit, same_problem

ONE, TWO = ("one", 1, None), ("two", 1, None)


@pytest.fixture
def rng():
    return np.random.default_rng(99)


@pytest.fixture
def rows(rng):
    return random_rows(rng, n=20, moving=17, groups=[0, 0, 1])


def unknowns(rng, rows, count, first=0):
    """Columns in all rows and channels; or of the last channel alone, in some rows each."""
    out = [rng.standard_normal((*r.residual.shape, count)) for r in rows]
    for x in out if first else ():
        x[:, :first] = 0.0
        for k in range(count):
            x[: 4 * k, :, k] = x[4 * k + 7 :, :, k] = 0.0
    return out


def patches(unknowns):
    """Each column by itself."""
    none = [Patches(u.shape[:2]) for u in unknowns]
    return [
        n.beside(Patches.of(c) for c in np.split(u, max(u.shape[2], 1), axis=2))
        for n, u in zip(none, unknowns, strict=True)
    ]


def alone(U, size, before=()):
    """Of a trial without unknowns of its own."""
    return Opened.of(Patches.of(U), size, np.zeros((*U.shape[:2], 0)), before)


def flat(x):
    return x.reshape(-1, x.shape[-1])


@pytest.mark.parametrize("size", [0.01, 1.0, 300.0])
def test_transformed_rows_and_price_are_the_dense_likelihood(rng, size):
    U = rng.standard_normal((10, 3, 4))
    U[..., 3] = U[..., 0] - 2.0 * U[..., 1]  # dependent: three directions
    opened = alone(U, size)
    dense = np.eye(30) + size**2 * flat(U) @ flat(U).T
    for _ in range(3):
        y = rng.standard_normal((10, 3, 1))
        white = flat(opened(y)).ravel()
        expected = multivariate_normal.logpdf(y.ravel(), np.zeros(30), dense)
        got = -0.5 * white @ white - opened.price - 15.0 * np.log(2 * np.pi)
        assert got == pytest.approx(expected, abs=1e-6)


def test_columns_that_are_looked_at_again_are_beside_what_is_there_then(rng):
    """What they become is kept for a while: beside other unknowns, other sizes or other own columns it is another."""
    own = [orthonormal(rng.standard_normal((10, 3, k))) for k in (2, 3)]
    others = [Opened.of(Patches.of(rng.standard_normal((10, 3, 2))), size, own[0]) for size in (0.5, 2.0)]
    others += [other.of_size(7.0) for other in others]
    columns, y = Patches.of(rng.standard_normal((10, 3, 4))), rng.standard_normal((10, 3, 2))
    cases = [(2.0, each, ()) for each in own] + [(1.0, own[0], (other,)) for other in others]
    for size, each, before in cases * 2:
        again = Opened.of(columns, size, each, before)
        anew = Opened.of(replace(columns), size, each, before)
        assert again.price == pytest.approx(anew.price, rel=1e-12)
        np.testing.assert_allclose(again(y), anew(y), rtol=1e-12, atol=1e-12)
    assert len({round(Opened.of(columns, *case).price, 6) for case in cases}) == len(cases)


def test_what_is_transformed_is_white(rng):
    U = rng.standard_normal((10, 3, 4))
    whiten = flat(alone(U, 2.0)(np.eye(30).reshape(10, 3, 30)))
    dense = np.eye(30) + 4.0 * flat(U) @ flat(U).T
    np.testing.assert_allclose(whiten @ dense @ whiten.T, np.eye(30), atol=1e-9)


def test_one_after_the_other_is_both_together(rng):
    U, V, y = (rng.standard_normal((10, 3, k)) for k in (4, 2, 1))
    first = alone(U, 2.0)
    second = alone(V, 0.7, [first])
    white = through([first, second], y)
    dense = np.eye(30) + 4.0 * flat(U) @ flat(U).T + 0.49 * flat(V) @ flat(V).T
    assert np.sum(white**2) == pytest.approx(y.ravel() @ np.linalg.solve(dense, y.ravel()))
    assert first.price + second.price == pytest.approx(0.5 * np.linalg.slogdet(dense)[1])


def test_nothing_open_costs_nothing(rng):
    y = rng.standard_normal((10, 3, 2))
    for columns in (np.zeros((10, 3, 0)), np.zeros((10, 3, 2))):
        opened = alone(columns, 5.0)
        assert opened.price == 0.0
        np.testing.assert_array_equal(opened(y), y)


@pytest.mark.parametrize("firsts", [(0, 0), (2, 2), (0, 2), (2, 0)])
def test_problem_with_unknowns_is_made_of_transformed_rows(rng, rows, firsts):
    """Gram matrices are updated, not made anew; where unknowns show in some channels only, in the others, too."""
    problem = Problem.of(rows, CANDIDATES)
    U, V = (unknowns(rng, rows, count, first) for count, first in zip((4, 2), firsts, strict=True))
    U[1] = U[1][..., :0]  # nothing is open in the second trial
    wider = problem.with_unknowns(ONE, patches(U), 3.0).with_unknowns(TWO, patches(V), 0.5)
    for t, cells in enumerate(wider.cells):
        spectrum = cells.spectrum(wider.rows(t))
        np.testing.assert_allclose(wider.spectra_of(t, slice(None)), spectrum, atol=1e-10)
        for cell, gram in enumerate(cells.grams(spectrum, spectrum)):
            np.testing.assert_allclose(wider.cell_grams[t].whole(cell), gram, atol=1e-8)


@pytest.mark.parametrize("firsts", [(0, 0), (2, 2), (0, 2)])
@pytest.mark.parametrize("free", [(), (1,), (2, 3)])
def test_fit_with_unknowns_is_generalised_least_squares(rng, rows, free, firsts):
    """Dense covariances, with every trial's own unknowns as free columns; their values, too."""
    U, V = (unknowns(rng, rows, count, first) for count, first in zip((4, 2), firsts, strict=True))
    problem = (
        Problem.of(rows, CANDIDATES).with_unknowns(ONE, patches(U), 3.0).with_unknowns(TWO, patches(V), 0.5)
    )
    noise = [
        np.eye(r.residual.size) + 9.0 * flat(u) @ flat(u).T + 0.25 * flat(v) @ flat(v).T
        for r, u, v in zip(rows, U, V, strict=True)
    ]
    fit, expected = Fit.of(problem, free), brute(rows, CANDIDATES, free, noise=noise)
    same_fit(fit, expected)
    for t in problem.trials:
        np.testing.assert_allclose(fit.local(t), expected.local[t], rtol=1e-6)
        assert np.sum(fit.remaining(t) ** 2) == pytest.approx(expected.data_misfit[t])


def test_price_is_that_of_what_own_unknowns_leave(rng, rows):
    """Half of the log determinant on the complement of the trial's own unknowns."""
    U, V = unknowns(rng, rows, 4), unknowns(rng, rows, 2)
    problem = Problem.of(rows, CANDIDATES)
    assert problem.price == 0.0
    expected = 0.0
    for r, u, v in zip(rows, U, V, strict=True):
        own = np.linalg.qr(flat(r.local), mode="complete")[0][:, r.local.shape[2] :]
        K = np.eye(r.residual.size) + 9.0 * flat(u) @ flat(u).T + 0.25 * flat(v) @ flat(v).T
        expected += 0.5 * np.linalg.slogdet(own.T @ K @ own)[1]
    both = problem.with_unknowns(ONE, patches(U), 3.0).with_unknowns(TWO, patches(V), 0.5)
    assert both.price == pytest.approx(expected)


def test_unknowns_that_are_taken_away_leave_no_trace(rng, rows):
    problem, U, V = Problem.of(rows, CANDIDATES), unknowns(rng, rows, 4), unknowns(rng, rows, 2)
    both = problem.with_unknowns(ONE, patches(U), 3.0).with_unknowns(TWO, patches(V), 0.5)
    same_problem(both.without_unknowns(()), problem)
    same_problem(both.without_unknowns((ONE,)), problem.with_unknowns(ONE, patches(U), 3.0))
    same_problem(both.without_unknowns((TWO,)), problem.with_unknowns(TWO, patches(V), 0.5))
    assert both.without_unknowns((TWO,)).price == pytest.approx(
        problem.with_unknowns(TWO, patches(V), 0.5).price
    )
    assert both.without_unknowns((ONE, TWO)) is both
    assert both.with_unknowns(ONE, patches(V), 9.0) is both  # open already
    assert problem.with_unknowns(ONE, patches([u[..., :0] for u in U]), 3.0) is problem


def test_what_changes_later_is_transformed_too(rng, rows):
    problem, U = Problem.of(rows, CANDIDATES), unknowns(rng, rows, 4)
    residuals, columns = [rng.standard_normal(r.residual.shape) for r in rows], unknowns(rng, rows, 1)
    opened = problem.with_unknowns(ONE, patches(U), 3.0)
    same_problem(
        opened.with_residual(residuals).with_columns(0, CANDIDATES[0], columns),
        problem.with_residual(residuals)
        .with_columns(0, CANDIDATES[0], columns)
        .with_unknowns(ONE, patches(U), 3.0),
    )
    event = CANDIDATES[2]
    same_problem(
        opened.extended(event, columns), problem.extended(event, columns).with_unknowns(ONE, patches(U), 3.0)
    )


@pytest.mark.parametrize("first", [0, 2])
def test_what_changes_between_two_is_transformed_by_both(rng, rows, first):
    problem, U, V = Problem.of(rows, CANDIDATES), unknowns(rng, rows, 4, first), unknowns(rng, rows, 2, first)
    columns, other = unknowns(rng, rows, 1), unknowns(rng, rows, 1)
    V[2] = V[2][..., :0]  # nothing is open in the third trial
    opened = problem.with_unknowns(ONE, patches(U), 3.0).with_columns(0, CANDIDATES[0], columns)
    opened = opened.with_unknowns(TWO, patches(V), 0.5).extended(CANDIDATES[2], other)
    anew = problem.with_columns(0, CANDIDATES[0], columns).extended(CANDIDATES[2], other)
    same_problem(opened, anew.with_unknowns(ONE, patches(U), 3.0).with_unknowns(TWO, patches(V), 0.5))


def test_nothing_stays_nothing() -> None:
    """A trial in which another cause leaves nothing open beside one that does."""
    opened = alone(np.random.default_rng(0).standard_normal((5, 2, 3)), 2.0)
    assert opened(np.zeros((5, 2, 0))).shape == (5, 2, 0)
