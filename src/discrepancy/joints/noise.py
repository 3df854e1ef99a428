"""What the sensors of a log add to the rows: as loud as their readings are where nothing moves."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, minimum_filter1d
from scipy.signal import welch

from discrepancy.joints.mechanics.regressor import rigid_torque, torque_of
from discrepancy.joints.signals import Signals, smoothing_hz, work_step
from estimator.arrays import Array
from estimator.filtering import differentiate, low_pass
from mocobot_logs.joints.joint_log import JointLog

TORQUE_BAND_HZ = (30.0, 120.0)
"""Where the torque's noise is read off: next to the rows, where little moves."""
TOP_SHARES, FILTERED_SHARES = (0.25, 0.45), (0.1, 0.2)
"""Where the noise of positions is read off, over the rate; the second of a log that was resampled."""
SEGMENT_S = 0.5
"""Of the spectra whose median over time is the noise: bursts, such as reversals, are not."""
STILL_S, STILL_STEPS = 0.1, 0.3
"""How long a position's reading must be the same, within which share of its step, to be without noise."""
LEAST_SHARE = 1e-3
"""Noise of a torque over its root mean square: no drive tells it better than to a thousandth."""
SEED = 8113


def sensor_noise(s: Signals) -> Array:
    """A draw of what the sensors add to the residual of a whole log, at the rate of its signals, shape (W, J)."""
    log, rate = s.log, s.log.rate_hz
    torque = np.nan_to_num(log.torque) if log.torque is not None else np.zeros_like(log.q)
    top = FILTERED_SHARES if log.resampled else TOP_SHARES
    low, high = TORQUE_BAND_HZ
    density = _density(torque, rate, min(low, top[0] * rate), min(high, top[1] * rate))
    density = np.maximum(density, (LEAST_SHARE**2) * np.mean(torque**2, axis=0) / (rate / 2.0))
    rounding = log.position_step**2 / 12.0 / (rate / 2.0)
    angle = np.maximum(_density(log.q, rate, top[0] * rate, top[1] * rate), rounding)
    rng = np.random.default_rng(SEED)
    white = np.sqrt(rate / 2.0) * rng.standard_normal((2, *log.q.shape))
    white[1] *= _changing(log)
    read, q = (
        low_pass(np.sqrt(d) * x, rate, smoothing_hz(rate))
        for d, x in zip((density, angle), white, strict=True)
    )
    dq = differentiate(q, rate)
    step = work_step(rate)
    moved = [
        x + noise[::step]
        for x, noise in zip((s.q, s.dq, s.ddq), (q, dq, differentiate(dq, rate)), strict=True)
    ]
    before = rigid_torque(s.motion) + s.tree.armature * s.ddq
    return read[::step] + before - torque_of(s.tree, *moved) - s.tree.armature * moved[2]


def _changing(log: JointLog) -> NDArray[np.bool_]:
    """Where the readings of positions change, shape (Q, J): one that stands still, by its step, has no noise at all."""
    size = max(3, 2 * round(STILL_S * log.rate_hz / 2.0) + 1)
    spread = maximum_filter1d(log.q, size, axis=0) - minimum_filter1d(log.q, size, axis=0)
    return spread > STILL_STEPS * log.position_step


def _density(x: Array, rate_hz: float, low: float, high: float) -> Array:
    """Power density of every channel in a band, median over time and frequency, shape (J,) per hertz."""
    size = min(len(x), max(16, round(SEGMENT_S * rate_hz)))
    starts = range(0, len(x) - size + 1, max(1, size // 2))
    frequency, each = np.zeros(0), []
    for start in starts:
        frequency, power = welch(x[start : start + size], rate_hz, nperseg=size, axis=0, detrend="linear")
        each.append(power)
    band = (frequency >= low) & (frequency <= high)
    if not band.any():
        band = frequency >= frequency[-1] / 2.0
    # A periodogram's ordinate scatters as chi-square of two degrees of freedom, whose median is ln 2 of its mean.
    return np.asarray(np.median(np.array(each)[:, band], axis=(0, 1)) / np.log(2.0))
