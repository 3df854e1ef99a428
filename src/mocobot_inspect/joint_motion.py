"""Smooth motion of a joint log, and how its other channels follow it: gains, delays and their standard errors.

Measured velocities, torques and commands are compared with the motion; what all joints share is told from all together.
"""

from __future__ import annotations

from collections.abc import Sequence
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
"""Samples looked at, at most: a model's torque takes 20 us a sample, and fifty mistakes are tried."""
MOVES = 1e-6
"""Spans below this are no motion [rad or m]."""
NOISES = 12.0
"""Spans below so many standard deviations of the noise behind the low-pass are no motion either."""

LONGEST_S = 0.1
"""Longest delay that is looked for [s]."""
FOLLOWS = 0.8
"""Correlation with the motion from which on a channel is taken to follow it, up to gain and delay."""
_UNKNOWN_S, _UNKNOWN = 2e-3, 0.2
"""A delay with a larger standard error than this [s], and than this share of a period, is not known."""
_APART, _GRID = 3.0, 0.02
"""Standard errors within which joints agree; share of a period to which interpolation tells a delay."""
_CLEAR = 0.5  # share of a signal that must not be noise for a correlation to mean anything
_ITERATIONS = 12
_BLOCKS = 10  # of a log, whose errors are independent of each other


@dataclass(frozen=True, eq=False)
class Motion:
    """Smooth motion and torques of J joints at Q samples, all through one low-pass.

    Attributes:
        log: what it is of.
        q, dq, ddq: positions and their derivatives, shape (Q, J).
        torque: shape (Q, J), NaN where a joint has none; a duty, which is a torque but for its gain and what the
            speed takes off it, where it has that instead.
        torque_noise: noise of the torques that the low-pass lets through, shape (J,).
        at: the samples' numbers in the log, shape (Q,).
    """

    log: JointLog
    q: Array
    dq: Array
    ddq: Array
    torque: Array
    torque_noise: Array
    at: NDArray[np.int64]

    @property
    def moves(self) -> NDArray[np.bool_]:
        """Whether each joint moves, shape (J,)."""
        noise = passed_noise(self.log, self.log.q[self.at], self.q)
        least = np.maximum(np.maximum(MOVES, 3.0 * self.log.position_step), NOISES * noise)
        return np.ptp(self.q, axis=0) > least


def motion_of(log: JointLog) -> Motion:
    """Smooth motion of a log, away from its ends and from gaps."""
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


@dataclass(frozen=True)
class Follows:
    """How a channel follows the motion.

    Attributes:
        joint: of the model, from 0.
        gain, gain_se: of the channel over the motion, and its standard error.
        delay_s, delay_se_s: of the channel after the motion, NaN where noise hides it, and its standard error [s].
        correlation: between them, the delay taken out; of its size only.
        possible: correlation that noise leaves of a channel that follows.
    """

    joint: int
    gain: float
    gain_se: float
    delay_s: float
    delay_se_s: float
    correlation: float
    possible: float

    @property
    def strays(self) -> bool:
        """Whether it follows less than noise explains."""
        return self.possible > _CLEAR and self.correlation < FOLLOWS * self.possible


def velocity_follows(motion: Motion) -> list[Follows]:
    """Measured velocities against differentiated positions, through one low-pass."""
    log = motion.log
    if log.dq is None:
        return []
    q = smooth(log, log.q)
    # A derivative's noise grows with frequency: 2 pi times the cut-off over sqrt(3) in all.
    noise = passed_noise(log, log.q, q) * 2.0 * np.pi * cutoff_hz(log) / np.sqrt(3.0)
    return _pairs(motion, log.dq, differentiate(q, log.rate_hz), noise)


def command_follows(motion: Motion) -> list[Follows]:
    """Positions against commanded ones: gain and delay of the motion after its command."""
    log = motion.log
    if log.command is None or log.drive.command != "position":
        return []
    command = smooth(log, log.command)
    return _pairs(motion, log.q, command, passed_noise(log, log.command, command))


def exchanged_commands(motion: Motion) -> list[tuple[int, int]]:
    """Pairs of joints that follow each other's command, and not their own, from 0."""
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
    """One delay for all joints and its standard error [s]; None where known ones differ, or there are not two."""
    known = [(one.delay_s, one.delay_se_s) for one in found if np.isfinite(one.delay_s)]
    delay, se = np.array(known).reshape(-1, 2).T
    if len(delay) < 2:
        return None
    mean = float(np.average(delay, weights=se**-2.0))
    return None if np.any(np.abs(delay - mean) > _APART * se) else (mean, float(np.sum(se**-2.0) ** -0.5))


def _pairs(motion: Motion, late_raw: Array, early: Array, noise: Array) -> list[Follows]:
    """Every moving joint's channel as gain times another one a little earlier, by least squares.

    Args:
        motion: of the robot.
        late_raw: the channel, not filtered, shape (Q, J).
        early: the other one, filtered, shape (Q, J).
        noise: what is left of its noise, shape (J,).
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
        for _ in range(_ITERATIONS):  # the delay enters linearly, and then what is left of it
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
        bias = max(float(clear[0]), _CLEAR)  # noise in what is followed makes the gain smaller
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
    """Least squares and its standard errors, from residuals that are alike for a while: block by block.

    Args:
        columns: shape (Q, P).
        y: shape (Q,).
    """
    size = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    scaled = columns / size
    inverse = np.linalg.pinv(scaled.T @ scaled, hermitian=True)
    values = inverse @ (scaled.T @ y)
    scores = scaled * (y - scaled @ values)[:, None]
    sums = np.stack([block.sum(axis=0) for block in np.array_split(scores, _BLOCKS)])
    covariance = inverse @ (sums.T @ sums) @ inverse * _BLOCKS / (_BLOCKS - 1.0)
    return values / size, np.sqrt(np.maximum(np.diag(covariance), 0.0)) / size


def _correlation(one: Array, other: Array) -> float:
    """Size of the correlation, 0 where one of them stands or is not known."""
    if not (np.isfinite(one).all() and np.isfinite(other).all()):
        return 0.0
    a, b = one - one.mean(), other - other.mean()
    size = float(np.sqrt(np.sum(a * a) * np.sum(b * b)))
    return abs(float(np.sum(a * b))) / size if size > 0 else 0.0
