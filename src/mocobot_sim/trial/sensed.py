"""What joint sensors see during a trial, densely enough to be read at other instants."""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from estimator.arrays import Array


@dataclass(frozen=True)
class SensedLog:
    """Joint angles and torque readings at the control rate, before zeros, noise and rounding.

    Attributes:
        rate_hz: control rate [Hz]; the first row is at t = 0.
        ticks: rows per sample of the recording.
        phi: driven angles [rad], shape (T, N, 3).
        theta: gimbal angles (z, y, x) [rad], shape (T, N, 3).
        tau: torque readings, minus design stiffness times deflection, through the sensor's lag [N m], (T, N, 3).
    """

    rate_hz: float
    ticks: int
    phi: Array
    theta: Array
    tau: Array

    def sampled(self, channel: str, delay_s: Array) -> Array:
        """A channel at the recording's instants, each robot's later by its delay.

        Delays need not be whole ticks: a cubic spline runs through the rows. Before the first and after the last
        row the end values hold.

        Args:
            channel: ``phi``, ``theta`` or ``tau``.
            delay_s: sample at t - delay [s], shape (N,).

        Returns:
            Values, shape (Q, N, 3).
        """
        values = getattr(self, channel)
        rows = values[:: self.ticks].copy()
        clock = np.arange(len(values)) / self.rate_hz
        for robot in np.flatnonzero(delay_s):
            at = np.clip(clock[:: self.ticks] - delay_s[robot], clock[0], clock[-1])
            rows[:, robot] = CubicSpline(clock, values[:, robot])(at)
        return rows
