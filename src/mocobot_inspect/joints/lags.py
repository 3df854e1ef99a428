"""Delays and gains between channels of a joint log: measured velocity, torque and command against the motion.

Every number has a standard error, and what all joints share is told from all joints together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from estimator.arrays import Array
from estimator.filtering import differentiate, low_pass
from mocobot_inspect.joints.motion import Motion, cutoff_hz, passed_noise, smooth
from mocobot_inspect.joints.wiring import columns_of, fit
from mocobot_logs.joints.joint_log import JointLog

LONGEST_S = 0.1
"""Longest delay that is looked for [s]."""
FOLLOWS = 0.8
"""Correlation with the motion from which on a channel is taken to follow it, up to gain and delay."""
SLOW = 0.4
"""Of a joint's rms speed; where it is slower, dry friction has any value, and leads or lags by milliseconds."""
SIGMAS = 5.0
"""Standard errors by which a number must differ from what it should be for it to be reported."""
_UNKNOWN_S, _UNKNOWN = 2e-3, 0.2
"""A delay with a larger standard error than this [s], and than this share of a period, is not known."""
_APART, _GRID = 3.0, 0.02
"""Standard errors within which joints agree; share of a period to which interpolation tells a delay."""
_CLEAR = 0.5  # share of a signal that must not be noise for a correlation to mean anything
_STEPS = 10  # delays tried on either side
_SHARPENED = 3
_ITERATIONS = 12
_BLOCKS = 10  # of a log, whose errors are independent of each other


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


def velocity_follows(log: JointLog, motion: Motion) -> list[Follows]:
    """Measured velocities against differentiated positions, through one low-pass."""
    if log.dq is None:
        return []
    q = smooth(log, log.q)
    # A derivative's noise grows with frequency: 2 pi times the cut-off over sqrt(3) in all.
    noise = passed_noise(log, log.q, q) * 2.0 * np.pi * cutoff_hz(log) / np.sqrt(3.0)
    return _pairs(log, motion, log.dq, differentiate(q, log.rate_hz), noise)


def command_follows(log: JointLog, motion: Motion) -> list[Follows]:
    """Positions against commanded ones: gain and delay of the motion after its command."""
    if log.command is None or log.drive.command != "position":
        return []
    command = smooth(log, log.command)
    return _pairs(log, motion, log.q, command, passed_noise(log, log.command, command))


def exchanged_commands(log: JointLog, motion: Motion) -> list[tuple[int, int]]:
    """Pairs of joints that follow each other's command, and not their own, from 0."""
    if log.command is None or log.drive.command != "position":
        return []
    q, command = motion.q, smooth(log, log.command)[motion.at]
    count = q.shape[1]
    size = np.array([[_correlation(command[:, j], q[:, k]) for k in range(count)] for j in range(count)])
    return [
        (j, k)
        for j in range(count)
        for k in range(j + 1, count)
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


def torque_delay(log: JointLog, motion: Motion, asked: Array) -> tuple[float, float, float, float] | None:
    """Delay of all torques after the motion and its standard error [s], and what is left of their variance, or None.

    The latter without the delay and with it. Samples in which a joint is slow are left out.

    Args:
        log: the log.
        motion: its motion.
        asked: torques of the model, shape (Q, J).
    """
    if log.torque is None:
        return None
    rate = log.rate_hz
    known = np.isfinite(log.torque).all(axis=0) & motion.moves
    if not known.any():
        return None
    torque = low_pass(log.torque[:, known], rate, cutoff_hz(log))
    slope = differentiate(torque, rate)
    joints = np.flatnonzero(known)
    most = min(LONGEST_S, 0.1 * len(log.time) / rate)
    time = np.arange(len(torque)) / rate
    speeds = motion.dq[:, joints]
    fast = np.abs(speeds) > SLOW * np.sqrt(np.mean(speeds**2, axis=0))

    def rest(k: int, delay_s: float) -> tuple[Array, Array, float]:
        """Columns of a joint's torque, what they leave of it, and the logarithm of that share."""
        at, j = fast[:, k], joints[k]
        late = np.interp(motion.at[at] / rate + delay_s, time, torque[:, k])
        values, left = fit(asked[at, j], motion.dq[at, j], motion.ddq[at, j], late)
        columns = columns_of(asked[at, j], motion.dq[at, j], motion.ddq[at, j])[:, values != 0.0]
        return columns, left, float(np.log(np.var(left) / max(np.var(late), 1e-30) + 1e-9))

    def shares(delay_s: float) -> float:
        return float(np.mean([rest(k, delay_s)[2] for k in range(len(joints))]))

    centre, width = 0.0, most
    for _ in range(_SHARPENED):
        tried = centre + np.linspace(-width, width, 2 * _STEPS + 1)
        centre, width = (
            float(tried[int(np.argmin([shares(float(delay)) for delay in tried]))]),
            width / _STEPS,
        )
    # One more step by Newton, joint by joint: they scatter by what the model lacks.
    steps, errors = [], []
    for k in range(len(joints)):
        columns, left, _ = rest(k, centre)
        moved = np.interp(motion.at[fast[:, k]] / rate + centre, time, slope[:, k])
        values, se = _solved(np.column_stack([-moved, columns]), left)
        steps.append(values[0])
        errors.append(se[0])
    weights = np.maximum(errors, 1e-12) ** -2.0
    scatter = np.sum(weights * np.square(steps)) / max(len(joints) - 1, 1)
    se = float(np.sqrt(max(1.0, scatter) / np.sum(weights)))
    return centre, se, float(np.exp(shares(0.0))), float(np.exp(shares(centre)))


def _pairs(log: JointLog, motion: Motion, late_raw: Array, early: Array, noise: Array) -> list[Follows]:
    """Every moving joint's channel as gain times another one a little earlier, by least squares.

    Args:
        log, motion: of the robot.
        late_raw: the channel, not filtered, shape (Q, J).
        early: the other one, filtered, shape (Q, J).
        noise: what is left of its noise, shape (J,).
    """
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
            (gain, shift, _), se = _solved(np.column_stack([now, -slope, np.ones_like(now)]), y)
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
                int(j), float(gain) / bias, float(np.hypot(se[0], gain * (1.0 - bias)) / bias),
                delay if known else np.nan, delay_se, correlation, float(np.sqrt(np.prod(clear))),
            )
        )  # fmt: skip
    return out


def _solved(columns: Array, y: Array) -> tuple[Array, Array]:
    """Least squares and its standard errors, from residuals that are alike for a while: block by block."""
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
