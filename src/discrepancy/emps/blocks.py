"""Where a time series is cut into the trials that validate each other."""

import numpy as np
from scipy.signal import fftconvolve

from discrepancy import rules
from discrepancy.emps.recording.signals import Signals
from estimator.arrays import Array


def period_of(reference: Array, rate_hz: float) -> int | None:
    """Samples after which the reference repeats itself at least once in full, or None."""
    count = len(reference)
    x = reference - reference.mean()
    least, most = round(rules.LEAST_PERIOD_S * rate_hz), count // 2
    if most <= least or np.ptp(x) == 0:
        return None
    squares = np.concatenate([[0.0], np.cumsum(x**2)])
    product = fftconvolve(x, x[::-1])[count - 1 :]
    lags = np.arange(least, most + 1)
    apart = (squares[count] - squares[lags]) + squares[count - lags] - 2.0 * product[lags]
    close = apart / (count - lags) < (rules.SAME_CYCLE_SHARE * np.ptp(x)) ** 2
    if not close.any():
        return None
    # The first run of lags that will do, and the best of it: neighbours of the period nearly do, too.
    first = int(np.argmax(close))
    run = first + int(np.argmin(np.append(close[first:], False)))
    lag = int(lags[first:run][np.argmin((apart / (count - lags))[first:run])])
    apart = np.abs(reference[lag:] - reference[:-lag]).max()
    return lag if apart <= rules.SAME_CYCLE_SHARE * np.ptp(x) else None


def blocks(signals: Signals, period: int | None) -> list[slice]:
    """Samples of every block.

    A block is one cycle of the reference where that repeats, else about six seconds. It begins where the axis moves
    steadily: there its measured position and velocity say all about its state, so that a simulation can start.
    """
    rate, count = signals.log.rate_hz, len(signals.x)
    first, last = round(rules.EDGE_S * rate), count - round(rules.EDGE_S * rate)
    number = max(2, round((last - first) / (period or rules.BLOCK_LENGTH_S * rate)))
    length = period or (last - first) // number
    starts = [_steady(signals, first, first + max(2, round(rules.CUT_SHARE * length)))]
    for k in range(1, number):
        near, reach = starts[0] + k * length, round(0.5 * rules.CUT_SHARE * length)
        starts.append(_steady(signals, near - reach, near + reach))
    return [slice(a, b) for a, b in zip(starts, [*starts[1:], last], strict=True)]


def _steady(signals: Signals, first: int, last: int) -> int:
    """The sample between two with the least acceleration, among those that move (if any does)."""
    here = slice(max(first, 0), last)
    fast = np.abs(signals.v[here]) > 0.3 * np.sqrt(np.mean(signals.v**2))
    usable = signals.log.usable[here]
    width = max(1, round(0.02 * signals.log.rate_hz))
    restless = np.convolve(np.abs(signals.a[here]), np.ones(width) / width, mode="same")
    restless[:width] += 1e3 * (len(restless) > 4 * width)  # the convolution sees one side only
    restless[-width:] += 1e3 * (len(restless) > 4 * width)
    cost = restless + np.where(fast, 0.0, 1e6) + np.where(usable, 0.0, 1e9)
    return here.start + int(np.argmin(cost))
