"""What a hypothesis leaves, cell by cell, over what its causes put there."""

from __future__ import annotations

import numpy as np

from discrepancy import rules
from discrepancy.inference.hypothesis import Hypothesis
from estimator.arrays import Array


def left_in_cells(hypothesis: Hypothesis) -> tuple[Array, Array]:
    """Sum of squares that the hypothesis leaves in every cell of all trials, and the numbers in it."""
    problem = hypothesis.problem
    x = np.append(-hypothesis.fit.coefficients, 1.0)
    left = [np.einsum("i,kij,j->k", x, grams, x, optimize=True) for grams in problem.cell_grams]
    return np.concatenate(left), np.concatenate([cells.sizes for cells in problem.cells]).astype(float)


def nats_left(hypothesis: Hypothesis) -> float:
    """What an explanation of all that is left would gain: half the log of every number's power."""
    pairs = zip(hypothesis.problem.power, hypothesis.problem.cells, strict=True)
    return sum(0.5 * float(cells.sizes @ np.log(np.maximum(power, 1.0))) for power, cells in pairs)


def unlisted_nats(hypothesis: Hypothesis) -> float:
    """By how many nats a process of its own in every cell is likelier than clean noise; each has to pay for itself.

    Rows that stand alone do not count: friction at rest, within its tolerance, shows in them alone.
    """
    left, sizes = left_in_cells(hypothesis)
    series = np.tile(np.arange(rules.CELL_BANDS + 1) < rules.CELL_BANDS, len(sizes) // (rules.CELL_BANDS + 1))
    at = (sizes > 0) & series
    clean = np.maximum(left[at] / sizes[at], rules.CLEAN_CHI2_PER_N) / rules.CLEAN_CHI2_PER_N
    gain = 0.5 * sizes[at] * (clean - 1.0 - np.log(clean)) - rules.CELL_NATS
    return float(np.sum(np.maximum(gain, 0.0)))


def share_left(hypothesis: Hypothesis, index: int) -> float:
    """Where a cause acts, the amplitude of what is left beyond noise over that of what it explains, from 0 to 1.

    The law of a cause that is really there leaves a small share; of one that imitates another, much.
    """
    problem, span = hypothesis.problem, hypothesis.problem.spans[index]
    values = hypothesis.fit.part(index)[0]
    trace = np.concatenate(
        [np.einsum("i,kij,j->k", values, g[:, span, span], values) for g in problem.cell_grams]
    )
    left, sizes = left_in_cells(hypothesis)
    excess = np.maximum(left - rules.CLEAN_CHI2_PER_N * sizes, 0.0)
    shares = excess / np.maximum(excess + trace, 1e-300)
    return float(np.sqrt(trace @ shares / max(float(np.sum(trace)), 1e-300)))
