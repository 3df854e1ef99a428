"""What a hypothesis leaves, cell by cell, over what its causes put there."""

from __future__ import annotations

import numpy as np

from discrepancy import rules
from discrepancy.candidate import Candidate
from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.least_squares.problem import Problem
from estimator.arrays import Array


def left_in_cells(hypothesis: Hypothesis) -> tuple[Array, Array]:
    """Sum of squares that the hypothesis leaves in every cell of all trials, and the numbers that it has for that."""
    problem = hypothesis.problem
    x = np.append(-hypothesis.fit.coefficients, 1.0)
    left = [grams.squares(x) for grams in problem.cell_grams]
    return np.concatenate(left), np.concatenate(problem.degrees)


def nats_left(hypothesis: Hypothesis) -> float:
    """What an explanation of all that is left would gain: half the log of every number's power."""
    pairs = zip(hypothesis.problem.power, hypothesis.problem.degrees, strict=True)
    return sum(0.5 * float(degrees @ np.log(np.maximum(power, 1.0))) for power, degrees in pairs)


def is_noise(chi2: float, samples: int, unlisted: float) -> bool:
    """Whether what is left counts as noise: a misfit of so many samples, and ``unlisted_nats``."""
    return chi2 <= rules.CLEAN_CHI2_PER_N * samples and unlisted < rules.UNLISTED_NATS


def unlisted_nats(hypothesis: Hypothesis) -> float:
    """By how many nats a process of its own in every cell is likelier than clean noise; each has to pay for itself.

    Clean is noise and what laws of another form than real ones leave (``Candidate.form_share``). Rows that stand alone
    do not count: friction at rest, within its tolerance, shows in them alone.
    """
    left, sizes = left_in_cells(hypothesis)
    series = np.tile(np.arange(rules.CELL_BANDS + 1) < rules.CELL_BANDS, len(sizes) // (rules.CELL_BANDS + 1))
    at = (sizes > 0.5) & series  # what has less has no numbers of its own
    level = rules.CLEAN_CHI2_PER_N + _other_forms(hypothesis)[at] / sizes[at]
    clean = np.maximum(left[at] / sizes[at], level) / level
    gain = 0.5 * sizes[at] * (clean - 1.0 - np.log(clean)) - rules.CELL_NATS
    return float(np.sum(np.maximum(gain, 0.0)))


def _other_forms(hypothesis: Hypothesis) -> Array:
    """Sum of squares in every cell of all trials that causes leave whose law has another form, free or tolerated."""
    problem, coefficients = hypothesis.problem, hypothesis.fit.coefficients
    total = np.zeros(sum(cells.sizes.size for cells in problem.cells))
    for candidate, span in zip(problem.candidates, problem.spans, strict=True):
        share = form_share_of(candidate, coefficients[span])
        if share:
            total += _power(problem, span, share * coefficients[span])
    return total


def form_share_of(candidate: Candidate, values: Array) -> float:
    """Share of its trace, in amplitude, by which a cause of some values (in units) has another form than its law.

    What is at rest until the load has changed by so much rests the longer the larger it is; in amplitude the share
    goes with the root.
    """
    if not candidate.form_share or not candidate.form_size:
        return candidate.form_share
    size = abs(float(values[0])) * candidate.parameters[0].unit
    larger = float(np.sqrt(max(size / candidate.form_size, 1.0)))
    return max(candidate.form_share, min(candidate.form_share * larger, rules.FORM_SHARE_MOST))


def _power(problem: Problem, span: slice, values: Array) -> Array:
    """Sum of squares in every cell of all trials of some columns with their values."""
    return np.concatenate([grams.squares(values, span.start) for grams in problem.cell_grams])


def share_left(hypothesis: Hypothesis, index: int) -> float:
    """Where a cause acts, the amplitude of what is left beyond noise over that of what it explains, from 0 to 1.

    The law of a cause that is really there leaves a small share; of one that imitates another, much.
    """
    problem, span = hypothesis.problem, hypothesis.problem.spans[index]
    values = hypothesis.fit.part(index)[0]
    trace = _power(problem, span, values)
    left, sizes = left_in_cells(hypothesis)
    excess = np.maximum(left - rules.CLEAN_CHI2_PER_N * sizes, 0.0)
    shares = excess / np.maximum(excess + trace, 1e-300)
    return float(np.sqrt(trace @ shares / max(float(np.sum(trace)), 1e-300)))


def trace_nats(hypothesis: Hypothesis, index: int) -> float:
    """What a cause's trace would leave if nothing stood for it: half its sum of squares, in the noise that there is."""
    problem, span = hypothesis.problem, hypothesis.problem.spans[index]
    trace = _power(problem, span, hypothesis.fit.part(index)[0])
    return 0.5 * float(np.sum(trace / np.concatenate(problem.power)))
