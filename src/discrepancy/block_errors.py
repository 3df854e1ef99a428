"""Standard errors that hold when what is left is correlated in time: a sandwich over blocks of rows."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from discrepancy.explanation import Explanation

Array = NDArray[np.float64]


def with_block_errors(explanation: Explanation, rows_per_block: int) -> Explanation:
    """The explanation with covariances from how the causes' scores vary between blocks of rows.

    The fit's own covariance takes whitened rows to be independent and of unit variance. What the named causes leave is
    neither where the model is not perfect. With H the normal matrix and g_b the score of block b,
    cov = B / (B - 1) H^-1 (sum_b g_b g_b^T) H^-1: the cluster-robust covariance of Liang and Zeger ("Longitudinal data
    analysis using generalized linear models", Biometrika 73, 1986), right for any correlation that ends within a block.

    Args:
        explanation: what the search found.
        rows_per_block: length of a block; longer than the correlation, short enough to leave a dozen blocks.
    """
    fit, problem = explanation.fit, explanation.problem
    scores = np.array(list(block_scores(explanation, rows_per_block)))
    if len(scores) < 2 or not explanation.found:
        return explanation
    spread = scores @ fit.covariance
    covariance = len(scores) / (len(scores) - 1) * spread.T @ spread
    found = []
    for index, item in zip(fit.free, explanation.found, strict=True):
        at = np.searchsorted(fit.used, np.arange(*problem.spans[index].indices(1 << 30)))
        units = problem.candidates[index].units
        found.append(replace(item, covariance=covariance[np.ix_(at, at)] * np.outer(units, units)))
    return replace(explanation, found=tuple(found))


def block_scores(explanation: Explanation, rows_per_block: int) -> Iterator[Array]:
    """Score of every block: its columns times what the fit leaves in it, one number per column in the fit."""
    fit, problem = explanation.fit, explanation.problem
    for t, rows in enumerate(problem.rows):
        left = fit.remaining(t)
        count = max(1, round(len(rows) / rows_per_block))
        for part in np.array_split(np.arange(len(rows)), count):
            yield np.einsum("ncl,nc->l", rows[part][..., fit.used], left[part])
