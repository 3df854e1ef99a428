"""A channel that oscillates faster than its robot moves: a loop near instability, or a hum that a sensor picks up."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import spectrogram

from estimator.arrays import Array
from estimator.quantisation import quantisation_step

ABOVE_HZ = 10.0
"""No motion of an Omnid is that fast."""
NOISES = 10.0
"""Amplitude over the channel's noise from which on it is worth a word; a sensor's own line is below."""
STEPS = 10.0
"""The same over its quantisation step: a slow joint climbs stairs of one."""
SHARE = 0.7
"""Least share of one line in all that is fast: a bump has none."""
WINDOW_S, WINDOW_ROWS = 2.5, 10_000
"""Length of a window, and rows of one at most: half of what is looked at together."""
_WIDTH = 3  # frequencies on either side of a line that are its own, in a Hann window


@dataclass(frozen=True)
class Oscillation:
    """A line in a channel's spectrum.

    Attributes:
        frequency_hz: where it is largest [Hz]; folded if it is above half the rate.
        amplitude: its largest [SI].
        duration_s: for how long it is there, in whole windows [s].
    """

    frequency_hz: float
    amplitude: float
    duration_s: float


def oscillation(x: Array, rate_hz: float) -> Oscillation | None:
    """The line that stands out of a channel's noise, or None.

    Args:
        x: consecutive samples, finite, shape (q,).
        rate_hz: their rate [Hz].
    """
    size = min(round(WINDOW_S * rate_hz), WINDOW_ROWS)
    if len(x) < size or rate_hz < 4.0 * ABOVE_HZ:
        return None
    frequency, _, density = spectrogram(x, rate_hz, window="hann", nperseg=size, noverlap=0, detrend="linear")
    fast = frequency >= ABOVE_HZ
    frequency, power = frequency[fast], density[fast] * (frequency[1] - frequency[0])
    total, peak = power.sum(axis=0), power.argmax(axis=0)
    near = np.abs(np.arange(len(power))[:, None] - peak) <= _WIDTH
    line = np.where(near, power, 0.0).sum(axis=0)
    # Powers of white noise are exponentially distributed: ln 2 of their mean is the median.
    noise = np.sqrt(np.median(power, axis=0) / np.log(2.0) * len(power))
    amplitude = np.sqrt(2.0 * line)
    least = np.maximum(NOISES * noise, STEPS * (quantisation_step(x) or 0.0))
    there = (amplitude > least) & (line > SHARE * total)
    if not there.any():
        return None
    at = int(np.argmax(np.where(there, amplitude, 0.0)))
    return Oscillation(
        float(frequency[peak[at]]), float(amplitude[at]), float(np.sum(there) * size / rate_hz)
    )


def joined(found: list[Oscillation]) -> Oscillation | None:
    """Those of successive parts of a channel in one, or None without any."""
    if not found:
        return None
    largest = max(found, key=lambda one: one.amplitude)
    return Oscillation(largest.frequency_hz, largest.amplitude, sum(one.duration_s for one in found))
