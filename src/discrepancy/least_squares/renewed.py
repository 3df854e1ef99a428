"""A problem with many columns replaced at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from discrepancy.least_squares.cell_grams import CellGrams
from discrepancy.least_squares.columns import Columns, Piece
from discrepancy.least_squares.problem import Problem
from estimator.arrays import Array


def renewed(problem: Problem, columns: Mapping[int, Sequence[Array]]) -> Problem:
    """The problem with other columns of some candidates, all in one: one by one they would take many times as long.

    Args:
        problem: of which causes leave nothing open.
        columns: by candidate, in its own units, shape (n, C, k) per trial.
    """
    if not columns:
        return problem
    made = [_of_trial(problem, t, {i: each[t] for i, each in columns.items()}) for t in problem.trials]
    grams = [CellGrams.of_columns(one, cells) for one, cells in zip(made, problem.cells, strict=True)]
    return replace(problem, columns=tuple(made), cell_grams=tuple(grams), by_own={})


def _of_trial(problem: Problem, trial: int, columns: Mapping[int, Array]) -> Columns:
    old, own, cells = problem.columns[trial], problem.explicable[trial], problem.cells[trial]
    new = np.concatenate([x * problem.candidates[i].units for i, x in columns.items()], axis=2)
    new = Columns.of(new, own, cells)
    at = np.concatenate([np.r_[problem.spans[i]] for i in columns])
    x, inside = old.take(slice(None)).copy(), old.inside.copy()
    x[..., at], inside[:, at] = new.take(slice(None)), new.inside
    return Columns((Piece.of(x.astype(old.pieces[0].whole.dtype, copy=False)),), inside)
