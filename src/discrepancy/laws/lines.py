"""Lines in the spectrum of what is left: a hum, which learnt powers of the noise would take in, an octave at a time."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import median_filter
from scipy.signal import find_peaks

from discrepancy import rules
from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.inference.remainder import unlisted_nats
from discrepancy.laws.bench import Bench
from discrepancy.least_squares.fit import Fit
from estimator.arrays import Array


def nats_beyond_noise(hypothesis: Hypothesis, bench: Bench) -> float:
    """By how many nats something unlisted is likelier than clean noise: a process of its own in cells, or a line."""
    return max(unlisted_nats(hypothesis), line_nats(hypothesis.fit, bench))


def line_nats(fit: Fit, bench: Bench) -> float:
    """By how many nats noise of another power at one frequency is likelier than that of its surroundings.

    The trial that shows most does not count: what one shows alone is its motion's, which may be periodic.
    """
    _, over, numbers = _spectra(fit, bench)
    nats = numbers[:, None] * (over - 1.0 - np.log(np.maximum(over, 1e-300))) * (over > 1.0)
    if len(nats) < 2:
        return 0.0
    return float(np.max(nats.sum(axis=0) - nats.max(axis=0)))


def peaks_hz(fit: Fit, bench: Bench) -> list[float]:
    """Frequencies at which most is left, of all trials and channels, over its surroundings."""
    grid, over, numbers = _spectra(fit, bench)
    prominence = numbers @ over
    peaks, _ = find_peaks(prominence)
    best = peaks[np.argsort(-prominence[peaks])][: rules.LAW_HUM_PEAKS]
    return [float(f) for f in grid[best]]


def _spectra(fit: Fit, bench: Bench) -> tuple[Array, Array, Array]:
    """Frequencies [Hz], shape (F,), the power there over its surroundings, (trials, F), and its numbers, (trials,)."""
    moving = {t: fit.problem.cells[t].moving for t in fit.problem.trials if fit.problem.cells[t].moving}
    # Rows that stand alone, such as holds, follow at times of their own.
    steps = [float(np.median(np.diff(bench.row_times(t)[:n]))) for t, n in moving.items() if n > 1]
    top = 0.5 / max(steps, default=np.inf)
    grid = np.arange(rules.LAW_HUM_LEAST_HZ, max(top, 2.0 * rules.LAW_HUM_LEAST_HZ), rules.LAW_HUM_STEP_HZ)
    over, numbers = [], []
    for t, n in moving.items():
        turned = np.exp(-2j * np.pi * grid[:, None] * bench.row_times(t)[:n])
        left = fit.remaining(t)[:n]
        power = np.sum(np.abs(turned @ left) ** 2, axis=1)
        over.append(
            power / np.maximum(median_filter(power, size=rules.LAW_LINE_SPAN, mode="nearest"), 1e-300)
        )
        numbers.append(left.shape[1])
    return grid, np.reshape(over, (len(over), len(grid))), np.array(numbers, dtype=np.float64)
