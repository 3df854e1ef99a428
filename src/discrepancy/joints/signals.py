"""Smoothed signals of one log, sensor noise in the residual torque, and torque changes from joint displacements."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
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
"""Cut-off before the nonlinear dynamics [Hz]. Chosen: three times the rows', so that filter and dynamics commute."""
SMOOTH_SHARE = 0.2
"""Upper limit of that cut-off over the sampling rate. Chosen: it must stay below the Nyquist frequency."""
WORK_RATIO = 4.0
"""Approximate sampling rate of the dynamics over ``SMOOTH_HZ``. Derived: aliases are damped to 1/80."""
CUTOFF_HZ = 20.0
"""Cut-off of the rows [Hz]. Chosen: arm motion is below 5 Hz, and structural resonances begin near 10 Hz."""
CUTOFF_SHARE = 0.15
"""Upper limit of that cut-off over the sampling rate. Chosen."""
SLOW_SHARE = 0.01
"""Share of a joint's typical speed below which the friction direction fades. Chosen."""
SLOW_ROUNDINGS = 2.0
"""Lower limit of that speed, in standard deviations of the velocity error from position rounding."""
REST = 1.5
"""Speed threshold for rest, in units of the speed below which the friction direction fades (``Signals.slow``)."""
LEAST_SPEED = 1e-6
"""Lower limit of the typical speed [rad/s or m/s]. Chosen: only prevents division by zero."""


@dataclass(frozen=True, eq=False)
class Signals:
    """Smoothed signals of one log at W samples for J joints.

    Attributes:
        log: the original log.
        tree: the nominal kinematic tree.
        rate_hz: sampling rate of these signals.
        time: [s], shape (W,).
        q, dq, ddq: smoothed joint positions and their derivatives, shape (W, J).
        torque: measured torque through the same filter, shape (W, J).
        usable: whether torque and motion of a joint are valid, shape (W, J).
        inverse: modelled torque without friction, shape (W, J).
        typical: typical (rms) speed of each joint over all logs, shape (J,).
        cutoff_hz: cut-off of the rows.
        enabled: whether the drives are on, shape (W,); None: not logged.
        held: intervals of the log in which an encoder holds its last value.
        spoilt: samples that these intervals change by more than noise, shape (W,); None: no such samples.
        by_delay: residual torque per second of delay of the commands, shape (W, J); None: torques are logged.
        by_limit: residual torque per share by which the largest torque of the drives is higher, shape (W, J); None: not
            in a closed loop.
        by_command: part of the torque that comes with the command, gain times command, shape (W, J); None: torques are
            logged, or a closed loop has the delays.
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
    by_delay: Array | None = None
    by_limit: Array | None = None
    by_command: Array | None = None

    @classmethod
    def of(cls, log: JointLog, tree: Tree, inverse_torque: Callable[[Array, Array, Array], Array]) -> Signals:
        """Smooth and differentiate at the full rate, then reduce the rate as the filter permits.

        Args:
            log: the log.
            tree: the nominal kinematic tree.
            inverse_torque: returns the modelled torque without friction from positions and their derivatives.
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
        )._with_commands()  # fmt: skip

    def _with_commands(self) -> Signals:
        """Add what a delay of the commands does, if they make all torques."""
        log, d = self.log, self.log.drive
        if log.command is None or not log.by_command or d.command != "position":
            return self
        told = low_pass(d.position_gain * log.command, log.rate_hz, smoothing_hz(log.rate_hz))
        rate = differentiate(told, log.rate_hz)
        step = work_step(log.rate_hz)
        return replace(self, by_command=told[::step], by_delay=rate[::step])

    @cached_property
    def motion(self) -> Motion:
        """Motion of the bodies of the tree."""
        return Motion.of(self.tree, self.q, self.dq, self.ddq)

    @property
    def slow(self) -> Array:
        """Speeds below which the friction direction fades, shape (J,): above the rounding noise of the velocity."""
        cutoff, rate = smoothing_hz(self.log.rate_hz), self.log.rate_hz
        # Treat rounding as white noise of variance step^2 / 12, low-passed and differentiated.
        rounding = self.log.position_step * 2.0 * np.pi * np.sqrt(cutoff**3 / (18.0 * rate))
        return np.maximum(SLOW_SHARE * self.typical, SLOW_ROUNDINGS * rounding)


def smoothing_hz(rate_hz: float) -> float:
    """Cut-off of the smoothing filter for a sampling rate."""
    return min(SMOOTH_HZ, SMOOTH_SHARE * rate_hz)


def cutoff_hz(rate_hz: float) -> float:
    """Cut-off of the rows for a sampling rate, if the drives report torques."""
    return min(CUTOFF_HZ, CUTOFF_SHARE * rate_hz)


def work_step(rate_hz: float) -> int:
    """Samples of the log for each sample of the dynamics."""
    return max(1, int(rate_hz / (WORK_RATIO * smoothing_hz(rate_hz))))


def _filled(log: JointLog) -> tuple[Array, NDArray[np.bool_]]:
    """Torques with gaps interpolated, and where they are valid, shape (Q, J) each."""
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
"""Band in which the torque noise is estimated [Hz]: above the rows, where there is little motion."""
TOP_SHARES, FILTERED_SHARES = (0.25, 0.45), (0.1, 0.2)
"""Band in which the position noise is estimated, over the sampling rate; the second is for resampled logs."""
SEGMENT_S = 0.5
"""Segment length of the spectra [s]. The median over time ignores bursts such as reversals."""
STILL_S, STILL_STEPS = 0.1, 0.3
"""A reading has no noise if it is constant for this time [s], within this share of its resolution."""
LEAST_SHARE = 1e-3
"""Lower limit of torque noise over the rms torque: no drive measures better than to 0.1 %."""
SEED = 8113


def sensor_noise(s: Signals) -> Array:
    """Sample of the sensor noise in the residual torque of a log, at the rate of its signals, shape (W, J)."""
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
    """Where position readings change, shape (Q, J); a constant reading has no noise."""
    size = max(3, 2 * round(STILL_S * log.rate_hz / 2.0) + 1)
    spread = maximum_filter1d(log.q, size, axis=0) - minimum_filter1d(log.q, size, axis=0)
    return spread > STILL_STEPS * log.position_step


def _density(x: Array, rate_hz: float, low: float, high: float) -> Array:
    """Noise power density of each channel in a band, median over time and frequency, shape (J,) per hertz."""
    size = min(len(x), max(16, round(SEGMENT_S * rate_hz)))
    starts = range(0, len(x) - size + 1, max(1, size // 2))
    frequency, each = np.zeros(0), []
    for start in starts:
        frequency, power = welch(x[start : start + size], rate_hz, nperseg=size, axis=0, detrend="linear")
        each.append(power)
    band = (frequency >= low) & (frequency <= high)
    if not band.any():
        band = frequency >= frequency[-1] / 2.0
    # Periodogram ordinates follow chi-square with two degrees of freedom, whose median is ln 2 times the mean.
    return np.asarray(np.median(np.array(each)[:, band], axis=(0, 1)) / np.log(2.0))


STEP_RAD, STEP_M = 1e-4, 1e-5
"""Steps for numerical derivatives: truncation and rounding errors are below 1e-6."""


def along(signals: Signals, at: int, way: Array) -> Array:
    """First-order change of the modelled torques for a displacement of one joint over time, shape (W, J).

    Args:
        signals: signals of one log.
        at: index of the joint.
        way: displacement [rad or m], shape (W,).
    """
    first = differentiate(way, signals.rate_hz)
    ways = (way, first, differentiate(first, signals.rate_hz))
    return np.asarray(sum(x * own[:, None] for x, own in zip(_partials(signals, at), ways, strict=True)))


def _partials(signals: Signals, at: int) -> list[Array]:
    """Derivatives of the torques by a joint's position, velocity and acceleration, shape (W, J) each; cached."""
    known = signals.__dict__.setdefault("_partials", {})
    if at not in known:
        known[at], step = [], STEP_M if signals.tree.slides[at] else STEP_RAD
        for k in range(3):
            moved = [signals.q, signals.dq, signals.ddq]
            moved[k] = moved[k].copy()
            moved[k][:, at] += step
            known[at].append((torque_of(signals.tree, *moved) - rigid_torque(signals.motion)) / step)
    return known[at]
