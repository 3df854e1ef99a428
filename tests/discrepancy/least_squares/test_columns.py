"""Columns in shared pieces, against whole arrays: what is taken, added up, multiplied and replaced."""

from __future__ import annotations

import numpy as np
import pytest

from discrepancy import rules
from discrepancy.least_squares.cells import Cells
from discrepancy.least_squares.columns import Columns, held, portions
from discrepancy.least_squares.fit import Fit
from discrepancy.least_squares.gram import orthonormal, project
from discrepancy.team.linear.patches import Patches
from discrepancy.least_squares.problem import Problem
from linear_problem import CANDIDATES, random_rows

N, C, K = 40, 3, 7


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(12)


@pytest.fixture
def case(rng: np.random.Generator) -> tuple[Columns, np.ndarray, np.ndarray, Cells]:
    x, own = rng.standard_normal((N, C, K)), orthonormal(rng.standard_normal((N, C, 2)))
    cells = Cells.of(N, C, 30)
    return Columns.of(x, own, cells), x, own, cells


def whole(columns: Columns) -> np.ndarray:
    return np.concatenate([np.asarray(piece.x, float) for piece in columns.pieces], axis=2)


def test_rows_come_back_as_they_were(case) -> None:
    columns, x, own, cells = case
    np.testing.assert_allclose(cells.series(columns.take(slice(None))) + own @ columns.inside, x, atol=1e-12)
    np.testing.assert_allclose(whole(columns), cells.spectrum(project(x, own)), atol=1e-12)


def test_replaced_columns_share_the_rest(case, rng: np.random.Generator) -> None:
    columns, x, own, cells = case
    for start, stop, count in ((2, 4, 2), (0, 1, 1), (3, 3, 2), (6, 7, 1), (7, 7, 1)):
        new = rng.standard_normal((N, C, count))
        changed = columns.replaced(start, stop, Columns.of(new, own, cells))
        expected = np.concatenate([x[..., :start], new, x[..., stop:]], axis=2)
        assert changed.width == expected.shape[2]
        z = cells.spectrum(project(expected, own))
        np.testing.assert_allclose(whole(changed), z, atol=1e-12)
        assert sum(np.shares_memory(piece.whole, columns.pieces[0].whole) for piece in changed.pieces) >= 1
        b, values = rng.standard_normal((N, C, 2)), rng.standard_normal(changed.width)
        flat = z.reshape(N * C, -1)
        np.testing.assert_allclose(changed.products(b), flat.T @ b.reshape(N * C, 2), atol=1e-10)
        np.testing.assert_allclose(changed.times(values), z @ values, atol=1e-10)
        np.testing.assert_allclose(changed.grams(cells, b), cells.grams(z, b), atol=1e-10)
        np.testing.assert_allclose(changed.own_grams(cells), cells.grams(z, z), atol=1e-10)
        for span in (slice(0, 3), slice(2, 5), slice(-1, None), slice(4, 4)):
            np.testing.assert_allclose(changed.take(span), z[..., span], atol=1e-12)


def test_many_columns_are_kept_in_single_precision(case) -> None:
    columns = case[0]
    size = N * C * K * 8
    assert not any(one.is_single for one in held([columns, columns], 2 * size))
    assert all(one.is_single for one in held([columns, columns], 2 * size - 1))
    assert all(one.is_single for one in held([columns.single(), columns], 2 * size - 1))


def test_columns_that_are_made_in_portions_are_the_same(case, rng: np.random.Generator, monkeypatch) -> None:
    """As many as take a given memory, at least one; a problem of them is that of all at once."""
    x = case[1]
    for most, widths in ((1, [2, 3, 2]), (5 * N * C * 8, [5, 2]), (5 * N * C * 8 + 1, [7])):
        parts = list(portions([x[..., :2], x[..., 2:5], x[..., 5:]], most))
        assert [part.shape[2] for part in parts] == widths
        np.testing.assert_array_equal(np.concatenate(parts, axis=2), x)
    rows = random_rows(rng)
    whole = Problem.of(rows, CANDIDATES)
    monkeypatch.setattr(rules, "PORTION_BYTES", 1)
    made = Problem.of(rows, CANDIDATES)
    assert len(made.columns[0].pieces) > 2
    np.testing.assert_allclose(made.grams, whole.grams, atol=1e-10)
    for t in whole.trials:
        every = slice(None)
        np.testing.assert_allclose(made.raw_columns(t, every), whole.raw_columns(t, every), atol=1e-12)


def test_a_fit_of_single_precision_is_the_same(rng: np.random.Generator, monkeypatch) -> None:
    """To what rounding of 6e-8 leaves of it; sums are made in double precision."""
    rows = random_rows(rng)
    double = Fit.of(Problem.of(iter(rows), CANDIDATES), [2])
    monkeypatch.setattr(rules, "ROWS_BYTES", 0)
    problem = Problem.of(rows, CANDIDATES)
    assert all(columns.is_single for columns in problem.columns)
    unknowns = [Patches.of(rng.standard_normal((*row.residual.shape, 2))) for row in rows]
    residuals = [row.residual for row in rows]
    single = Fit.of(problem.with_residual(residuals), [2])
    np.testing.assert_allclose(single.solution, double.solution, rtol=1e-5, atol=1e-6)
    for t in problem.trials:
        np.testing.assert_allclose(single.remaining(t), double.remaining(t), atol=1e-5)
    wide = [p.with_unknowns(("x", 1, None), unknowns, 0.5) for p in (double.problem, problem)]
    np.testing.assert_allclose(wide[0].grams, wide[1].grams, rtol=1e-5, atol=1e-4)
