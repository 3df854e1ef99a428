"""Statistics of whitened residuals over all trials: running rms, rms in bins, spectrum; white unit noise gives 1."""

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.signal import welch

from discrepancy.result.traces import Trace
from estimator.arrays import Array

RUNNING_S = 1.0
BINS = 12
SEGMENT_S, LEAST_ROWS = 10.0, 16


def running_rms(square: Array, rate_hz: float) -> Array:
    """Root of the mean over ``RUNNING_S`` of a squared series, shape (n,) -> (n,)."""
    width = max(1, round(RUNNING_S * rate_hz))
    if not len(square):
        return np.zeros(0)
    return np.sqrt(np.maximum(uniform_filter1d(square, min(width, len(square)), mode="nearest"), 0.0))


def multiples(trace: Trace, white: Array, columns: Sequence[int]) -> Array:
    """Rms of some whitened channels over time in multiples of clean data, shape (n,): running, but for holds."""
    square = np.mean(white[:, list(columns)] ** 2, axis=1)
    moving = running_rms(square[: trace.moving], trace.rate_hz)
    return np.concatenate([moving, np.sqrt(square[trace.moving :])])


def binned(traces: Sequence[Trace], attribute: str, columns: list[int], quantity: str) -> tuple[Array, Array]:
    """Mean of a quantity and rms of some channels in bins of equal counts, shapes (b,)."""
    x = np.concatenate([trace.quantities[quantity] for trace in traces])
    square = np.concatenate([np.mean(getattr(trace, attribute)[:, columns] ** 2, axis=1) for trace in traces])
    order = np.argsort(x, kind="stable")
    parts = [part for part in np.array_split(order, min(BINS, len(x))) if len(part)]
    return np.array([x[p].mean() for p in parts]), np.array([np.sqrt(square[p].mean()) for p in parts])


def spectrum(traces: Sequence[Trace], attribute: str, columns: list[int]) -> tuple[Array, Array] | None:
    """Frequencies [Hz] and root of the power density over that of white noise of unit variance, shapes (f,).

    Only rows in motion count, and only trials of the first one's rate that are long enough; pauses between them are
    passed over. None where there is no such trial.
    """
    rate = traces[0].rate_hz
    used = [trace for trace in traces if trace.moving >= LEAST_ROWS and trace.rate_hz == rate]
    if not used:
        return None
    segment = min(round(SEGMENT_S * rate), min(trace.moving for trace in used))
    total = np.zeros(segment // 2 + 1)
    for trace in used:
        series = getattr(trace, attribute)[: trace.moving, columns]
        _, density = welch(series, rate, nperseg=segment, axis=0, detrend="constant")
        total += trace.moving * density.mean(axis=1) * rate / 2.0
    height = np.sqrt(total / sum(trace.moving for trace in used))
    # The mean is taken out of every segment, so frequency 0 says nothing; the last one is not doubled.
    if segment % 2 == 0:
        height[-1] *= np.sqrt(2.0)
    return np.asarray(np.fft.rfftfreq(segment, 1.0 / rate)[1:], dtype=float), height[1:]
