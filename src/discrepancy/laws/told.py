"""What a fit says about further columns: of all together, or of each group by itself."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from discrepancy.least_squares.fit import Fit
from estimator.arrays import Array


class Beside:
    """Further whitened columns beside all that a fit has in its model.

    Args:
        fit: with the noise's powers and the spreads of its problem.
    """

    def __init__(self, fit: Fit) -> None:
        self._fit = fit
        problem = fit.problem
        self._roots = [np.sqrt(weights).reshape(-1, 1) for weights in problem.weights]
        self._columns = np.append(fit.used, problem.width - 1)
        self._models: dict[int, Array] = {}

    def rows(self, trial: int, columns: Array) -> Array:
        """Whitened columns (n, C, k) of one trial in the transform and over the noise, shape (n C, k)."""
        own = self._fit.problem.spectrum(trial, columns).reshape(-1, columns.shape[2])
        own *= self._roots[trial]
        return own

    def edges(self, trial: int, rows: Array) -> tuple[Array, Array]:
        """Products of such rows with the model's columns, (used, k), and their score vector beside the fit, (k,)."""
        problem = self._fit.problem
        if problem.columns[trial].is_single:  # too many to be held a second time
            weighted = (rows * self._roots[trial]).reshape(*problem.cells[trial].index.shape, -1)
            edge = problem.products(trial, weighted)[self._columns]
        else:
            edge = self._model(trial).T @ rows
        return edge[:-1], edge[-1] - self._fit.solution @ edge[:-1]

    def _model(self, trial: int) -> Array:
        """The model's columns and the residual as such rows, shape (n C, used + 1), made once."""
        if trial not in self._models:
            every = self._fit.problem.spectra_of(trial, slice(None)).reshape(len(self._roots[trial]), -1)
            self._models[trial] = every[:, self._columns] * self._roots[trial]
        return self._models[trial]

    def each(self, blocks: Iterable[Array], groups: Sequence[int]) -> list[tuple[Array, Array]]:
        """Information and score vector of every group of columns by itself.

        Args:
            blocks: whitened columns of every trial, shape (n, C, k).
            groups: successive columns in each group; they add up to k.
        """
        edge, score, squares = 0.0, 0.0, [np.zeros((size, size)) for size in groups]
        spans = np.concatenate([[0], np.cumsum(groups)])
        for trial, block in enumerate(blocks):
            rows = self.rows(trial, block)
            own, told = self.edges(trial, rows)
            edge, score = edge + own, score + told
            for k, square in enumerate(squares):
                part = rows[:, spans[k] : spans[k + 1]]
                square += part.T @ part
        covered = self._fit.covariance @ np.asarray(edge)
        out = []
        for k, square in enumerate(squares):
            at = slice(spans[k], spans[k + 1])
            out.append((square - np.asarray(edge)[:, at].T @ covered[:, at], np.asarray(score)[at]))
        return out
