"""Smooth signals of a recording: position and its derivatives, the force that the drive is told, the loop's error."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from discrepancy import rules
from discrepancy.emps.recording.axis_log import FIRST_GUESS_KG, AxisLog
from estimator.arrays import Array
from estimator.filtering import differentiate, low_pass


@dataclass(frozen=True, eq=False)
class Signals:
    """Of all samples of one recording, shape (Q,) each.

    Attributes:
        log: the recording.
        x, v, a: smoothed position [m], velocity [m/s], acceleration [m/s^2].
        u: voltage through the same filter [V].
        force: gain times voltage [N]. The drive holds a sample's voltage until the next, so what acts at a sample is
            the mean of the hold before and after it: half a period old on average.
        error: reference minus position [m].
        command: what the nominal loop asks for [V].
    """

    log: AxisLog
    x: Array
    v: Array
    a: Array
    u: Array
    force: Array
    error: Array
    command: Array

    @classmethod
    def of(cls, log: AxisLog) -> Signals:
        """Smooth and differentiate."""
        rate = log.rate_hz
        x, reference, u = (smooth(series, rate) for series in (log.position, log.reference, log.voltage))
        v = differentiate(x, rate)
        a = differentiate(v, rate)
        error = reference - x
        command = log.kv_Vs_per_m * (log.kp_per_s * error - v)
        force = log.gain_N_per_V * at_delay(u, rate, 0.5 / rate)
        return cls(log, x, v, a, u, force, error, command)

    @property
    def residual(self) -> Array:
        """Nominal residual, shape (Q, 2): force told minus that of a frictionless mass [N], voltage minus law [V]."""
        return np.column_stack([self.force - FIRST_GUESS_KG * self.a, self.u - self.command])


def smooth(x: Array, rate_hz: float) -> Array:
    """The filter that comes before differentiating, for everything alike, shape (Q, ...)."""
    return low_pass(x, rate_hz, min(rules.EMPS_SMOOTH_HZ, 0.2 * rate_hz))


def at_delay(x: Array, rate_hz: float, delay_s: float) -> Array:
    """x(t - delay) of even samples, shape (Q,); held at the ends."""
    time = np.arange(len(x)) / rate_hz
    at = np.clip(time - delay_s, 0.0, time[-1])
    # The last piece meets the last sample but for rounding, and what is held is the sample.
    return np.where(at < time[-1], CubicSpline(time, x)(at), x[-1])
