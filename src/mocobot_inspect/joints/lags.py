"""Delays and gains between channels of a joint log: measured velocity, torque and command against the motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from estimator.arrays import Array
from estimator.filtering import differentiate, low_pass
from mocobot_inspect.joints.motion import Motion, cutoff_hz, smooth
from mocobot_inspect.joints.wiring import fit
from mocobot_logs.joints.joint_log import JointLog

LONGEST_S = 0.1
"""Longest delay that is looked for [s]."""
FOLLOWS = 0.8
"""Correlation with the motion from which on a channel is taken to follow it, up to gain and delay."""
SLOW = 0.4
"""Of a joint's rms speed; where it is slower, dry friction has any value, and leads or lags by milliseconds."""
_STEPS = 10  # delays tried on either side
_SHARPENED = 3


@dataclass(frozen=True)
class Follows:
    """How a channel follows the motion.

    Attributes:
        joint: of the model, from 0.
        gain: of the channel over the motion.
        delay_s: of the channel after the motion [s].
        correlation: between them, the delay taken out; of its size only.
    """

    joint: int
    gain: float
    delay_s: float
    correlation: float


def velocity_follows(log: JointLog, motion: Motion) -> list[Follows]:
    """Measured velocities against differentiated positions, through one low-pass."""
    if log.dq is None:
        return []
    measured = smooth(log, log.dq)
    derived = differentiate(smooth(log, log.q), log.rate_hz)
    return _pairs(log, motion, measured, derived)


def command_follows(log: JointLog, motion: Motion) -> list[Follows]:
    """Positions against commanded ones: gain and delay of the motion after its command."""
    if log.command is None or log.drive.command != "position":
        return []
    return _pairs(log, motion, smooth(log, log.q), smooth(log, log.command))


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


def torque_delay(log: JointLog, motion: Motion, asked: Array) -> tuple[float, float, float] | None:
    """Delay of all torques after the motion [s], and what is left of their variance without and with it, or None.

    Samples in which a joint is slow are left out.

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
    joints = np.flatnonzero(known)
    most = min(LONGEST_S, 0.1 * len(log.time) / rate)
    time = np.arange(len(torque)) / rate
    speeds = motion.dq[:, joints]
    fast = np.abs(speeds) > SLOW * np.sqrt(np.mean(speeds**2, axis=0))

    def left(delay_s: float) -> float:
        total = 0.0
        for k, j in enumerate(joints):
            at = fast[:, k]
            late = np.interp((motion.at[at] / rate) + delay_s, time, torque[:, k])
            _, rest = fit(asked[at, j], motion.dq[at, j], motion.ddq[at, j], late)
            total += float(np.log(np.var(rest) / max(np.var(late), 1e-30) + 1e-9))
        return total / len(joints)

    centre, width = 0.0, most
    for _ in range(_SHARPENED):
        tried = centre + np.linspace(-width, width, 2 * _STEPS + 1)
        found = [left(float(delay)) for delay in tried]
        centre, width = float(tried[int(np.argmin(found))]), width / _STEPS
    return centre, float(np.exp(left(0.0))), float(np.exp(left(centre)))


def _pairs(log: JointLog, motion: Motion, late: Array, early: Array) -> list[Follows]:
    """Every moving joint's channel as gain times another one a little earlier, by least squares."""
    rate, samples = differentiate(np.nan_to_num(early), log.rate_hz), np.arange(len(early))
    out = []
    for j in np.flatnonzero(motion.moves):
        y = late[motion.at, j]
        if not (np.isfinite(y).all() and np.isfinite(early[:, j]).all()) or np.std(y) == 0:
            continue
        delay = 0.0
        for _ in range(_SHARPENED):  # the delay enters linearly, and then what is left of it
            at = motion.at - delay * log.rate_hz
            now, slope = np.interp(at, samples, early[:, j]), np.interp(at, samples, rate[:, j])
            columns = np.column_stack([now, -slope, np.ones_like(now)])
            gain, shift, _ = np.linalg.lstsq(columns, y, rcond=None)[0]
            if gain == 0.0 or abs(delay + shift / gain) > LONGEST_S:
                break
            delay += float(shift / gain)
        now = np.interp(motion.at - delay * log.rate_hz, samples, early[:, j])
        gain = float(np.linalg.lstsq(np.column_stack([now, np.ones_like(now)]), y, rcond=None)[0][0])
        out.append(Follows(int(j), gain, delay, _correlation(now, y)))
    return out


def _correlation(one: Array, other: Array) -> float:
    """Size of the correlation, 0 where one of them stands or is not known."""
    if not (np.isfinite(one).all() and np.isfinite(other).all()):
        return 0.0
    a, b = one - one.mean(), other - other.mean()
    size = float(np.sqrt(np.sum(a * a) * np.sum(b * b)))
    return abs(float(np.sum(a * b))) / size if size > 0 else 0.0
