"""Zero-phase low-pass filter, high-order differences and trimming of uniformly sampled signals."""

import math
from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from estimator.arrays import Array
from estimator.errors import InputError

BUTTERWORTH_ORDER = 3
MIN_SAMPLES = 16  # for the filter's padding and the widest difference
_HALF_WIDTH = 3


def low_pass(x: ArrayLike, rate_hz: float, cutoff_hz: float) -> Array:
    """Apply a third-order Butterworth filter forward and backward along axis 0 (paper, section IV.B).

    The phase is zero. The two passes square the magnitude to 1 / (1 + (f / cutoff)^6) in the analogue prototype, so it
    is 1/2, not 1/sqrt(2), at the cut-off.

    Args:
        x: samples, shape (Q, ...).
        rate_hz: sampling rate [Hz].
        cutoff_hz: cut-off of one pass [Hz], below half the sampling rate.

    Raises:
        InputError: the cut-off is outside (0, rate/2), or there are fewer than 16 samples.
    """
    x = _samples(x)
    if not 0.0 < cutoff_hz < rate_hz / 2.0:
        raise InputError(f"cutoff_hz is {cutoff_hz!r}; it must lie between 0 and {rate_hz / 2.0:g} Hz")
    sections = _sections(float(rate_hz), float(cutoff_hz))
    # The slowest transient decays as exp(-pi cutoff t): six periods of padding leave 1e-8 of it.
    padding = min(len(x) - 1, math.ceil(6.0 * rate_hz / cutoff_hz))
    from scipy.signal import sosfiltfilt  # slow import (0.4 s); checks and simulations do not need it

    return sosfiltfilt(sections, x, axis=0, padlen=padding)


@cache
def _sections(rate_hz: float, cutoff_hz: float) -> Array:
    """Return the filter's second-order sections; cached because a diagnosis uses few filters very often."""
    from scipy.signal import butter

    return np.asarray(butter(BUTTERWORTH_ORDER, cutoff_hz, fs=rate_hz, output="sos"), dtype=np.float64)


def differentiate(x: ArrayLike, rate_hz: float) -> Array:
    """Differentiate along axis 0 by a sixth-order central difference, same shape, unit of x per second.

    At frequency f its gain is i w (1 - (w/rate)^6 / 140 + ...), w = 2 pi f. At 5 Hz and 100 Hz sampling it is 7e-6
    low; the usual two-point difference is 1.6 % low. The three samples at each end use one-sided differences on the
    same seven samples, also of sixth order but with larger error constants.

    Args:
        x: samples, shape (Q, ...).
        rate_hz: sampling rate [Hz].

    Raises:
        InputError: fewer than 16 samples.
    """
    # Equals scipy's savgol_filter(x, 7, 6, deriv=1) without the 4e-15 error of its weights, which changes the small
    # errors of noise-free recordings by a relative 5e-7.
    x = _samples(x)
    n, width = len(x), 2 * _HALF_WIDTH + 1
    y = np.empty_like(x)
    centre = slice(_HALF_WIDTH, n - _HALF_WIDTH)
    weights = _difference_weights(_HALF_WIDTH)
    y[centre] = sum(w * x[k : n - width + 1 + k] for k, w in enumerate(weights) if k != _HALF_WIDTH)
    for k in range(_HALF_WIDTH):
        weights = _difference_weights(k)
        y[k] = np.tensordot(weights, x[:width], axes=1)
        y[n - 1 - k] = -np.tensordot(weights, x[: n - width - 1 : -1], axes=1)
    return y * rate_hz


def trim_slice(samples: int, rate_hz: float, trim_s: float) -> slice:
    """Return the indices that remain after dropping ``trim_s`` seconds at each end (paper, section IV.B: two seconds).

    Raises:
        InputError: trim_s is negative or not finite, or no sample remains.
    """
    if not (np.isfinite(trim_s) and trim_s >= 0.0):
        raise InputError(f"trim_s is {trim_s!r}; it must be a finite number of seconds, at least 0")
    drop = round(trim_s * rate_hz)
    if samples <= 2 * drop:
        raise InputError(
            f"{samples} samples are too few: dropping {trim_s:g} s at each end at {rate_hz:g} Hz "
            f"needs more than {2 * drop}"
        )
    return slice(drop, samples - drop)


def _samples(x: ArrayLike) -> Array:
    x = np.atleast_1d(np.asarray(x, dtype=float))
    if len(x) < MIN_SAMPLES:
        raise InputError(f"{len(x)} samples are too few; at least {MIN_SAMPLES} are needed")
    return x


@cache
def _difference_weights(at: int) -> Array:
    """Return weights of the first derivative at node ``at`` of the nodes 0..6, exact for polynomials of degree 6."""
    nodes = np.arange(2 * _HALF_WIDTH + 1) - at
    powers = np.vander(nodes, increasing=True).T.astype(float)
    return np.linalg.solve(powers, np.eye(len(nodes))[1])
