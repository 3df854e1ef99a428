"""Standard errors that hold when what is left is correlated in time: a sandwich over blocks of rows."""

from collections.abc import Iterator

import numpy as np

from discrepancy.least_squares.fit import Fit
from discrepancy.least_squares.problem import Problem
from estimator.arrays import Array


def block_covariance(fit: Fit, rows_per_block: int) -> Array:
    """Covariance of a fit's solution from how its scores vary between blocks of rows, shape (used, used), in units.

    The fit's own covariance takes whitened rows to be independent and of unit variance. What the named causes leave is
    neither where the model is not perfect. With H the normal matrix and g_b the score of block b,
    cov = B / (B - 1) H^-1 (sum_b g_b g_b^T) H^-1: the cluster-robust covariance of Liang and Zeger ("Longitudinal data
    analysis using generalized linear models", Biometrika 73, 1986), right for any correlation that ends within a block.

    Args:
        fit: a solution.
        rows_per_block: length of a block; longer than the correlation, short enough to leave a dozen blocks.
    """
    scores = np.array(list(block_scores(fit, rows_per_block)))
    if len(scores) < 2:
        return fit.covariance
    spread = scores @ fit.covariance
    return np.asarray(len(scores) / (len(scores) - 1) * spread.T @ spread, dtype=np.float64)


def block_scores(fit: Fit, rows_per_block: int) -> Iterator[Array]:
    """Score of every block: its columns times what the fit leaves in it, one number per column in the fit."""
    for t in fit.problem.trials:
        rows = weighted_rows(fit.problem, t)
        left = rows @ np.append(-fit.coefficients, 1.0)
        count = max(1, round(len(rows) / rows_per_block))
        for part in np.array_split(np.arange(len(rows)), count):
            yield np.einsum("ncl,nc->l", rows[part][..., fit.used], left[part])


def weighted_rows(problem: Problem, trial: int) -> Array:
    """Rows of a trial as a fit weighs them: every cell of the noise over its power, shape (n, C, columns)."""
    spectra = problem.spectra_of(trial, slice(None))
    return problem.cells[trial].series(spectra * np.sqrt(problem.weights[trial]))


def part_of(fit: Fit, covariance: Array, index: int) -> Array:
    """One candidate's part of a covariance of a fit's solution, shape (k, k)."""
    at = fit.at(index)
    return np.asarray(covariance[np.ix_(at, at)], dtype=np.float64)
