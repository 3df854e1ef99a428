"""Smooth motion and torques of a joint log, thinned to what an inspection looks at."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_erosion

from estimator.arrays import Array
from estimator.filtering import differentiate, low_pass
from mocobot_logs.joints.joint_log import JointLog

CUTOFF_HZ, CUTOFF_SHARE = 10.0, 0.1
"""Low-pass of positions and torques alike: motion of robots is slower; a tenth of the rate where that is little."""
MOST_ROWS = 1500
"""So many samples are looked at: a model's torque takes 20 us a sample, and fifty mistakes are tried."""
MOVES = 1e-6
"""Smaller spans are no motion [rad or m]."""
NOISES = 12.0
"""Nor are spans of less than so many standard deviations of what noise the low-pass lets through."""


@dataclass(frozen=True, eq=False)
class Motion:
    """Of Q samples, J joints, all through one low-pass.

    Attributes:
        log: what it is of.
        q, dq, ddq: positions and their derivatives, shape (Q, J).
        torque: shape (Q, J), NaN where a joint has none; a duty, which is a torque but for its gain and what the
            speed takes off it, where it has that instead.
        at: the samples' numbers in the log, shape (Q,).
        step: samples of the log from one to the next.
    """

    log: JointLog
    q: Array
    dq: Array
    ddq: Array
    torque: Array
    at: NDArray[np.int64]
    step: int

    @property
    def moves(self) -> NDArray[np.bool_]:
        """Whether each joint moves, shape (J,)."""
        noise = passed_noise(self.log, self.log.q[self.at], self.q)
        least = np.maximum(np.maximum(MOVES, 3.0 * self.log.position_step), NOISES * noise)
        return np.ptp(self.q, axis=0) > least


def cutoff_hz(log: JointLog) -> float:
    """Cut-off of the low-pass [Hz]."""
    return min(CUTOFF_HZ, CUTOFF_SHARE * log.rate_hz)


def smooth(log: JointLog, values: Array) -> Array:
    """A signal of the log through the low-pass, shape (Q, ...); joints without one stay NaN."""
    known = np.isfinite(values)
    return np.where(known, low_pass(np.where(known, values, 0.0), log.rate_hz, cutoff_hz(log)), np.nan)


def passed_noise(log: JointLog, raw: Array, smoothed: Array) -> Array:
    """Noise that the low-pass lets through, shape (J,).

    What it takes off is noise, and as much of white noise is left as its band is of the whole.
    """
    return np.std(raw - smoothed, axis=0) * np.sqrt(2.0 * cutoff_hz(log) / log.rate_hz)


def effort(log: JointLog) -> Array:
    """What drives every joint: its torque, else its duty, NaN where it has neither, shape (Q, J)."""
    torque = np.full(log.q.shape, np.nan) if log.torque is None else log.torque
    duty = log.drive.duty
    return torque if duty is None else np.where(np.isnan(torque).all(axis=0), duty, torque)


def motion_of(log: JointLog) -> Motion:
    """Smooth motion of a log, away from its ends and from gaps."""
    rate = log.rate_hz
    q = smooth(log, log.q)
    dq = differentiate(q, rate)
    ddq = differentiate(dq, rate)
    torque = smooth(log, effort(log))
    edge = max(4, round(0.3 * rate / cutoff_hz(log)))
    inner = np.asarray(binary_erosion(log.usable, iterations=edge, border_value=0))
    at = np.flatnonzero(inner)
    step = max(1, -(-len(at) // MOST_ROWS))
    at = at[::step]
    return Motion(log, q[at], dq[at], ddq[at], torque[at], at, step)
