"""Smooth motion of a joint log, and gain and delay of its other channels against it, with standard errors.

Measured velocities are compared with differentiated positions, and positions with their commands. A delay common to
all joints is estimated from all together.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_erosion

from estimator.arrays import Array
from estimator.filtering import differentiate, low_pass
from mocobot_logs.joints.joint_log import JointLog

CUTOFF_HZ, CUTOFF_SHARE = 10.0, 0.1
"""Cut-off of the low-pass for positions and torques [Hz], above the motion of robots; at low rates this share of the
rate."""
MOST_ROWS = 1500
"""Largest number of samples used: inverse dynamics takes 20 us a sample, and about fifty mistakes are tried."""
MOVES = 1e-6  # smallest range that counts as motion [rad or m]
NOISES = 12.0  # smallest range that counts as motion, in standard deviations of the low-passed noise

LONGEST_S = 0.1  # longest delay that is searched [s]
FOLLOWS = 0.8  # least correlation with the motion at which a channel counts as following it
_UNKNOWN_S, _UNKNOWN = 2e-3, 0.2
"""Largest standard error of a known delay: the larger of this time [s] and this share of a period."""
_APART, _GRID = 3.0, 0.02
"""Standard errors within which joints agree; accuracy of interpolated delays, as a share of a period."""
_CLEAR = 0.5  # share of a signal's variance above noise that a meaningful correlation needs
_ITERATIONS = 12
_BLOCKS = 10  # blocks of a log whose errors count as independent


@dataclass(frozen=True, eq=False)
class Motion:
    """Smooth motion and torques of J joints at Q samples, all through the same low-pass."""

    log: JointLog
    # q, dq, ddq: positions and their derivatives, shape (Q, J)
    q: Array
    dq: Array
    ddq: Array
    # torques, shape (Q, J), NaN where a joint has none. A joint without a torque has its duty here, which is a torque
    # up to a gain and a term proportional to the speed.
    torque: Array
    torque_noise: Array  # noise of the torques after the low-pass, shape (J,)
    at: NDArray[np.int64]  # indices of the samples in the log, shape (Q,)

    @property
    def moves(self) -> NDArray[np.bool_]:
        """Whether each joint moves, shape (J,)."""
        noise = passed_noise(self.log, self.log.q[self.at], self.q)
        least = np.maximum(np.maximum(MOVES, 3.0 * self.log.position_step), NOISES * noise)
        return np.ptp(self.q, axis=0) > least


def motion_of(log: JointLog) -> Motion:
    """Return the smooth motion of a log, away from its ends and from gaps."""
    q = smooth(log, log.q)
    dq = differentiate(q, log.rate_hz)
    ddq = differentiate(dq, log.rate_hz)
    effort = np.full(log.q.shape, np.nan) if log.torque is None else log.torque
    if log.drive.duty is not None:
        effort = np.where(np.isnan(effort).all(axis=0), log.drive.duty, effort)
    torque = smooth(log, effort)
    edge = max(4, round(0.3 * log.rate_hz / cutoff_hz(log)))
    at = np.flatnonzero(binary_erosion(log.usable, iterations=edge, border_value=0))
    at = at[:: max(1, -(-len(at) // MOST_ROWS))]
    return Motion(log, q[at], dq[at], ddq[at], torque[at], passed_noise(log, effort[at], torque[at]), at)


def cutoff_hz(log: JointLog) -> float:
    """Return the cut-off frequency of the low-pass [Hz]."""
    return min(CUTOFF_HZ, CUTOFF_SHARE * log.rate_hz)


def smooth(log: JointLog, values: Array) -> Array:
    """Return a signal of the log after the low-pass, shape (Q, ...); NaN stays NaN."""
    known = np.isfinite(values)
    return np.where(known, low_pass(np.where(known, values, 0.0), log.rate_hz, cutoff_hz(log)), np.nan)


def passed_noise(log: JointLog, raw: Array, smoothed: Array) -> Array:
    """Estimate the noise after the low-pass, shape (J,).

    The removed part is taken as white noise; the remaining noise is proportional to the pass band's share.
    """
    return np.std(raw - smoothed, axis=0) * np.sqrt(2.0 * cutoff_hz(log) / log.rate_hz)


@dataclass(frozen=True)
class Follows:
    """Gain and delay of a channel against the motion."""

    joint: int  # index of the joint in the model, from 0
    # gain, gain_se: gain of the channel over the motion, and its standard error
    gain: float
    gain_se: float
    # delay_s, delay_se_s: delay of the channel behind the motion, NaN if noise hides it, and its standard error [s]
    delay_s: float
    delay_se_s: float
    correlation: float  # absolute correlation after the delay is removed
    possible: float  # largest correlation that the noise allows

    @property
    def strays(self) -> bool:
        """Whether the correlation is lower than noise explains."""
        return self.possible > _CLEAR and self.correlation < FOLLOWS * self.possible


def velocity_follows(motion: Motion) -> list[Follows]:
    """Compare measured velocities with differentiated positions, after the same low-pass."""
    log = motion.log
    if log.dq is None:
        return []
    q = smooth(log, log.q)
    # The noise of a derivative grows with frequency: in total by 2 pi times the cut-off over sqrt(3).
    noise = passed_noise(log, log.q, q) * 2.0 * np.pi * cutoff_hz(log) / np.sqrt(3.0)
    return _pairs(motion, log.dq, differentiate(q, log.rate_hz), noise)


def command_follows(motion: Motion) -> list[Follows]:
    """Compare positions with commanded ones: gain and delay of the motion behind its command."""
    log = motion.log
    if log.command is None or log.drive.command != "position":
        return []
    command = smooth(log, log.command)
    return _pairs(motion, log.q, command, passed_noise(log, log.command, command))


def exchanged_commands(motion: Motion) -> list[tuple[int, int]]:
    """Return pairs of joints, from 0, that follow each other's command instead of their own."""
    log = motion.log
    if log.command is None or log.drive.command != "position":
        return []
    command = smooth(log, log.command)[motion.at]
    size = np.array([[_correlation(c, q) for q in motion.q.T] for c in command.T])
    return [
        (j, k)
        for j in range(len(size))
        for k in range(j + 1, len(size))
        if min(size[j, k], size[k, j]) > FOLLOWS > max(size[j, j], size[k, k])
    ]


def pooled(found: Sequence[Follows]) -> tuple[float, float] | None:
    """Return one delay for all joints and its standard error [s]; None if fewer than two are known or they disagree."""
    known = [(one.delay_s, one.delay_se_s) for one in found if np.isfinite(one.delay_s)]
    delay, se = np.array(known).reshape(-1, 2).T
    if len(delay) < 2:
        return None
    mean = float(np.average(delay, weights=se**-2.0))
    return None if np.any(np.abs(delay - mean) > _APART * se) else (mean, float(np.sum(se**-2.0) ** -0.5))


def _pairs(motion: Motion, late_raw: Array, early: Array, noise: Array) -> list[Follows]:
    """Fit every moving joint's channel as a delayed copy of another one times a gain, by least squares.

    The delayed channel (Q, J) is not filtered, the other one (Q, J) is; ``noise`` (J,) is that after the filter.
    """
    log = motion.log
    late = smooth(log, late_raw)
    late_noise = passed_noise(log, late_raw, late)
    rate, samples = differentiate(np.nan_to_num(early), log.rate_hz), np.arange(len(early))
    least = max(_UNKNOWN_S, _UNKNOWN / log.rate_hz)
    out = []
    for j in np.flatnonzero(motion.moves):
        y = late[motion.at, j]
        if not (np.isfinite(y).all() and np.isfinite(early[:, j]).all()) or np.std(y) == 0:
            continue
        delay, step, gain, se, now = 0.0, np.inf, 0.0, np.zeros(3), y
        for _ in range(_ITERATIONS):  # Newton iteration: the model is linear in the remaining delay
            at = motion.at - delay * log.rate_hz
            now, slope = np.interp(at, samples, early[:, j]), np.interp(at, samples, rate[:, j])
            (gain, shift, _), se = solved(np.column_stack([now, -slope, np.ones_like(now)]), y)
            step = float(shift / gain) if gain else np.inf
            if abs(delay + step) > LONGEST_S:
                break
            delay += step
        delay_se = float(np.hypot(se[1] / abs(gain), _GRID / log.rate_hz)) if gain else np.inf
        clear = 1.0 - np.minimum([noise[j] ** 2 / np.var(now), late_noise[j] ** 2 / np.var(y)], 1.0)
        correlation = _correlation(now, y)
        known = abs(step) < delay_se < least and correlation > FOLLOWS and clear[0] > _CLEAR
        bias = max(float(clear[0]), _CLEAR)  # noise in the regressor reduces the gain
        out.append(
            Follows(
                joint=int(j),
                gain=float(gain) / bias,
                gain_se=float(np.hypot(se[0], gain * (1.0 - bias)) / bias),
                delay_s=delay if known else np.nan,
                delay_se_s=delay_se,
                correlation=correlation,
                possible=float(np.sqrt(np.prod(clear))),
            )
        )
    return out


def solved(columns: Array, y: Array) -> tuple[Array, Array]:
    """Solve least squares (Q, P) x = (Q,); return x and standard errors that allow for correlation within blocks."""
    size = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    scaled = columns / size
    inverse = np.linalg.pinv(scaled.T @ scaled, hermitian=True)
    values = inverse @ (scaled.T @ y)
    scores = scaled * (y - scaled @ values)[:, None]
    sums = np.stack([block.sum(axis=0) for block in np.array_split(scores, _BLOCKS)])
    covariance = inverse @ (sums.T @ sums) @ inverse * _BLOCKS / (_BLOCKS - 1.0)
    return values / size, np.sqrt(np.maximum(np.diag(covariance), 0.0)) / size


def _correlation(one: Array, other: Array) -> float:
    """Return the absolute correlation, 0 if a signal is constant or unknown."""
    if not (np.isfinite(one).all() and np.isfinite(other).all()):
        return 0.0
    a, b = one - one.mean(), other - other.mean()
    size = float(np.sqrt(np.sum(a * a) * np.sum(b * b)))
    return abs(float(np.sum(a * b))) / size if size > 0 else 0.0
