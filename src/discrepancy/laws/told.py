"""What a fit says about further columns: of all together, or of each group by itself."""

from __future__ import annotations

from collections.abc import Sequence

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
        columns = np.append(fit.used, problem.raw[0].shape[2] - 1)
        roots = [np.sqrt(weights) for weights in problem.weights]
        self._roots = [root.reshape(-1, 1) for root in roots]
        # Rows of the model and the residual, over the noise, as flat matrices.
        self._model = [
            (spectra[..., columns] * root).reshape(-1, len(columns))
            for spectra, root in zip(problem.spectra, roots, strict=True)
        ]

    def rows(self, trial: int, columns: Array) -> Array:
        """Whitened columns (n, C, k) of one trial in the transform and over the noise, shape (n C, k)."""
        own = self._fit.problem.spectrum(trial, columns)
        return own.reshape(-1, columns.shape[2]) * self._roots[trial]

    def edges(self, trial: int, rows: Array) -> tuple[Array, Array]:
        """Products of such rows with the model's columns, (used, k), and their score vector beside the fit, (k,)."""
        edge = self._model[trial].T @ rows
        return edge[:-1], edge[-1] - self._fit.solution @ edge[:-1]

    def each(self, blocks: Sequence[Array], groups: Sequence[int]) -> list[tuple[Array, Array]]:
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
