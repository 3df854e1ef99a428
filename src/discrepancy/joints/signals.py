"""Smooth signals of one log: positions and their derivatives, torques, and what the nominal model asks for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from discrepancy.joints.mechanics.motion import Motion
from discrepancy.joints.mechanics.tree import Tree
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
"""The same, at least, over what rounding of the positions makes of a velocity. Chosen: two standard deviations; a joint
that creeps through the steps of a coarse encoder has no direction."""
LEAST_SPEED = 1e-6
"""Typical speed of a joint that does not move [rad/s or m/s]. Chosen: no more than a number to divide by."""


@dataclass(frozen=True, eq=False)
class Signals:
    """Of W samples at the rate of the mechanics, J joints.

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
        """Of the nominal tree's bodies."""
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
