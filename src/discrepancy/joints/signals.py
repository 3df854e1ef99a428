"""Smooth signals of one log, the noise of its sensors in the rows, and torques of a displaced joint."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, minimum_filter1d
from scipy.signal import welch

from discrepancy.joints.mechanics import Motion, Tree, rigid_torque, torque_of
from estimator.arrays import Array
from estimator.filtering import differentiate, low_pass
from estimator.quantisation import Held, doubtful, filled
from mocobot_logs.joints.joint_log import JointLog

SMOOTH_HZ = 60.0
"""Cut-off before the nonlinear formulas. Chosen: three times the rows', so that filtering and they commute."""
SMOOTH_SHARE = 0.2
"""The same over the sampling rate, at most. Chosen: a cut-off must stay below half of it."""
WORK_RATIO = 4.0
"""Rate of the mechanics over ``SMOOTH_HZ``, about. Derived: what it folds back has been damped to 1/80."""
CUTOFF_HZ = 20.0
"""Cut-off of the rows. Chosen: arms move below 5 Hz, and bend from some 10 Hz on."""
CUTOFF_SHARE = 0.15
"""The same over the sampling rate, at most. Chosen."""
SLOW_SHARE = 0.01
"""Share of a joint's typical speed below which the direction of friction fades. Chosen."""
SLOW_ROUNDINGS = 2.0
"""Least such speed, in standard deviations of the velocity that rounding of positions makes."""
LEAST_SPEED = 1e-6
"""Typical speed of a joint that does not move [rad/s or m/s]. Chosen: no more than a number to divide by."""


@dataclass(frozen=True, eq=False)
class Signals:
    """W samples at the rate of the mechanics, J joints.

    Attributes:
        log: what they are of.
        tree: the nominal one.
        rate_hz: of the samples.
        time: [s], shape (W,).
        q, dq, ddq: smoothed joint positions and their derivatives, shape (W, J).
        torque: through the same filter, shape (W, J).
        usable: samples and joints whose torque and motion are what they seem, shape (W, J).
        inverse: torques that the nominal model asks for without friction, shape (W, J).
        typical: speed of every joint while it moves, over all logs (root mean square), shape (J,).
        cutoff_hz: of the rows.
        enabled: whether the drives are on, shape (W,); None where the log does not say.
        held: positions of the log whose encoder holds its last value.
        spoilt: samples that these change by more than noise, shape (W,); None: none does.
    """

    log: JointLog
    tree: Tree
    rate_hz: float
    time: Array
    q: Array
    dq: Array
    ddq: Array
    torque: Array
    usable: NDArray[np.bool_]
    inverse: Array
    typical: Array
    cutoff_hz: float
    enabled: NDArray[np.bool_] | None = None
    held: tuple[Held, ...] = ()
    spoilt: NDArray[np.bool_] | None = None

    @classmethod
    def of(cls, log: JointLog, tree: Tree, inverse_torque: Callable[[Array, Array, Array], Array]) -> Signals:
        """Smooth, differentiate at the full rate, and keep as many samples as the filter leaves.

        Args:
            log: what to smooth.
            tree: the nominal one.
            inverse_torque: torques of the model without friction from positions and their derivatives.
        """
        rate = log.rate_hz
        step = work_step(rate)
        q, held, doubt = filled(log.q, log.position_step)
        spoilt = doubtful(doubt, rate, cutoff_hz(rate))[::step] if held else None
        q = low_pass(q, rate, smoothing_hz(rate))
        dq = differentiate(q, rate)
        ddq = differentiate(dq, rate)
        torque, known = _filled(log)
        torque = low_pass(torque, rate, smoothing_hz(rate))
        here = slice(None, None, step)
        q, dq, ddq, torque = q[here], dq[here], ddq[here], torque[here]
        inverse = inverse_torque(q, dq, ddq)
        typical = np.maximum(np.sqrt(np.mean(dq**2, axis=0)), LEAST_SPEED)
        return cls(
            log, tree, rate / step, log.time[here], q, dq, ddq, torque, known[here], inverse, typical, cutoff_hz(rate),
            None if log.enabled is None else log.enabled[here], held, spoilt,
        )  # fmt: skip

    @cached_property
    def motion(self) -> Motion:
        """Motion of the nominal tree's bodies."""
        return Motion.of(self.tree, self.q, self.dq, self.ddq)

    @property
    def slow(self) -> Array:
        """Speeds below which the direction of friction fades, shape (J,): slow, and told from the reading's steps."""
        cutoff, rate = smoothing_hz(self.log.rate_hz), self.log.rate_hz
        # Rounding as white noise of step^2 / 12, low-passed and differentiated.
        rounding = self.log.position_step * 2.0 * np.pi * np.sqrt(cutoff**3 / (18.0 * rate))
        return np.maximum(SLOW_SHARE * self.typical, SLOW_ROUNDINGS * rounding)


def smoothing_hz(rate_hz: float) -> float:
    """Cut-off of the first filter."""
    return min(SMOOTH_HZ, SMOOTH_SHARE * rate_hz)


def cutoff_hz(rate_hz: float) -> float:
    """Cut-off of the rows of a log of some rate, whose drives tell their torques."""
    return min(CUTOFF_HZ, CUTOFF_SHARE * rate_hz)


def work_step(rate_hz: float) -> int:
    """Samples of a log to one of the mechanics."""
    return max(1, int(rate_hz / (WORK_RATIO * smoothing_hz(rate_hz))))


def _filled(log: JointLog) -> tuple[Array, NDArray[np.bool_]]:
    """Torques with what is missing interpolated, and where nothing was missing, shape (Q, J) each."""
    if log.torque is None:
        return np.zeros_like(log.q), np.zeros(log.q.shape, dtype=bool)
    known = np.isfinite(log.torque)
    torque = np.where(known, log.torque, 0.0)
    for j in range(torque.shape[1]):
        good = known[:, j]
        if good.any() and not good.all():
            torque[:, j] = np.interp(log.time, log.time[good], torque[good, j])
    return torque, known & log.usable[:, None]


TORQUE_BAND_HZ = (30.0, 120.0)
"""Where the torque's noise is read off: next to the rows, where little moves."""
TOP_SHARES, FILTERED_SHARES = (0.25, 0.45), (0.1, 0.2)
"""Where the noise of positions is read off, over the rate; the second of a log that was resampled."""
SEGMENT_S = 0.5
"""Length of the spectra whose median over time is the noise: bursts, such as reversals, are not [s]."""
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


STEP_RAD, STEP_M = 1e-4, 1e-5
"""Steps of differences by joint positions: their squares and rounding are both below 1e-6."""


def along(signals: Signals, at: int, way: Array) -> Array:
    """Change of the nominal torques per unit of a change of one joint's position over time, shape (W, J).

    Args:
        signals: of one log.
        at: the joint.
        way: in which direction and how far, shape (W,).
    """
    first = differentiate(way, signals.rate_hz)
    ways = (way, first, differentiate(first, signals.rate_hz))
    return np.asarray(sum(x * own[:, None] for x, own in zip(_partials(signals, at), ways, strict=True)))


def _partials(signals: Signals, at: int) -> list[Array]:
    """Change of the torques with a joint's position, velocity and acceleration, shape (W, J) each; remembered."""
    known = signals.__dict__.setdefault("_partials", {})
    if at not in known:
        known[at], step = [], STEP_M if signals.tree.slides[at] else STEP_RAD
        for k in range(3):
            moved = [signals.q, signals.dq, signals.ddq]
            moved[k] = moved[k].copy()
            moved[k][:, at] += step
            known[at].append((torque_of(signals.tree, *moved) - rigid_torque(signals.motion)) / step)
    return known[at]
