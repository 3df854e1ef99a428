"""Offset and drift between the clocks of two robots by least squares on their whole angular velocities.

With q_1(t) and q_i(s) the filtered angular velocities by the stamps of either robot, the residuals are

    e(t) = q_1(t) - (1 + drift) R_1i q_i(s(t)),    s(t) = t + offset + drift (t - middle),

with R_1i unknown as well; a clock that runs fast makes rates small. The filter commutes with R_1i, so whatever it
takes away it takes from both. q_i between its samples is a quintic spline; far below half the sampling rate that is
the band-limited signal.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline
from scipy.signal import butter, sosfiltfilt
from scipy.spatial.transform import Rotation

from estimator import so3
from estimator.arm.gimbal import rate_matrix
from estimator.arrays import Array
from estimator.estimate.grasps import pair_rotation
from estimator.filtering import differentiate
from estimator.statistics import rms

CUTOFF_HZ = 0.7
"""Of the first-order low-pass, run forward and backward. White noise of encoders grows in proportion to frequency in
rates: from about here on the filter turns rates into something like angles, in which that noise is even, and the motion
of a payload ends below 1 Hz. Sharper filters at 1 to 3 Hz scatter 1.0 to 1.6 times as much."""
TRIM_S = 2.0
"""Dropped at both ends of a stream against transients of the filter [s]."""
STEP_LIMIT_S = 0.5
"""A fit that moves further than this from where it began has lost its place [s]."""
_ITERATIONS = 20
_CONVERGED_S = 1e-10
_RATE_HZ = 25.0


class Rates:
    """Filtered angular velocity of one robot's grasp, by its own stamps.

    Attributes:
        rate_hz: about 25 Hz; the filter leaves little beyond half of that.
        time: stamps [s] that the filter's transients have left, at that rate, shape (Q,).
        q: angular velocity in {i} [rad/s], shape (Q, 3).
        spline: the same between samples, through all that were recorded.
        change: its derivative [rad/s^2].
    """

    def __init__(self, theta: Array, start_s: float, rate_hz: float) -> None:
        """Take gimbal angles [rad], shape (Q, 3), with Q well above 2 ``TRIM_S`` seconds."""
        omega = np.einsum("qij,qj->qi", rate_matrix(theta), differentiate(theta, rate_hz))
        keep = slice(round(TRIM_S * rate_hz), len(theta) - round(TRIM_S * rate_hz))
        time, q = start_s + np.arange(len(theta))[keep] / rate_hz, _smooth(omega, rate_hz)[keep]
        every = max(1, int(rate_hz / _RATE_HZ))
        self.rate_hz, self.time, self.q = rate_hz / every, time[::every], q[::every]
        self.spline: BSpline = make_interp_spline(time, q, k=5)
        self.change: BSpline = self.spline.derivative()


@dataclass(frozen=True)
class ClockFit:
    """Least-squares fit over some samples of robot 1.

    Attributes:
        offset_s, drift: s = t + offset + drift (t - middle) [s], [-].
        samples: those of robot 1 that are in the fit.
        half_s: half their length [s].
        R: R_1i.
        residual: e, shape (Q, 3) [rad/s].
        rotated_rate: J columns of the rotation, shape (Q, 3, 3), those of directions that turn nothing left out.
        change: R_1i dq_i/ds [rad/s^2], the derivative by the offset up to its sign, shape (Q, 3).
        mismatch: rms of e over rms of q_1.
    """

    offset_s: float
    drift: float
    samples: slice
    half_s: float
    R: Array
    residual: Array
    rotated_rate: Array
    change: Array
    mismatch: float


def fit_clock(
    first: Rates,
    other: Rates,
    part: slice,
    middle_s: float,
    offset_s: float,
    drift: float = 0.0,
    *,
    with_drift: bool = True,
) -> ClockFit | None:
    """Gauss-Newton from a guess; None if it goes astray or less than half of the samples overlap.

    Args:
        first, other: robots 1 and i.
        part: samples of robot 1 to use as far as robot i has any at their instants.
        middle_s: instant of robot 1 at which ``offset_s`` is meant [s].
        offset_s, drift: the guess.
        with_drift: whether to fit the drift, or keep it.
    """
    wanted = first.time[part]
    at = wanted + offset_s + drift * (wanted - middle_s)
    inside = np.flatnonzero((at >= other.time[0] + STEP_LIMIT_S) & (at <= other.time[-1] - STEP_LIMIT_S))
    if len(inside) < max(0.5 * len(wanted), 16):
        return None
    start = (part.start or 0) + int(inside[0])
    part = slice(start, start + len(inside))
    time, q_1 = first.time[part], first.q[part]
    centre, half_s = (time[0] + time[-1]) / 2, (time[-1] - time[0]) / 2
    lever = ((time - centre) / half_s)[:, None]
    # Offset at the centre of the samples: uncorrelated with the drift.
    guess = here = offset_s + drift * (centre - middle_s)

    def moved() -> tuple[Array, Array]:
        """q_i and its derivative at robot 1's instants, per second of robot 1."""
        at = time + here + drift * (time - centre)
        return (1.0 + drift) * other.spline(at), (1.0 + drift) * other.change(at)

    q_i, q_dot = moved()
    R = pair_rotation(q_1, q_i)
    for _ in range(_ITERATIONS):
        change = q_dot @ R.T
        columns = [_turning(q_i @ R.T), change[..., None]]
        columns += [(lever * change)[..., None]] if with_drift else []
        J = np.concatenate(columns, axis=-1).reshape(q_1.size, -1)
        size = np.linalg.norm(J, axis=0)
        size[size == 0.0] = 1.0
        residual = (q_1 - q_i @ R.T).ravel()
        step = np.linalg.lstsq(J / size, residual, rcond=1e-9)[0] / size
        shift, stretch = step[3], step[4] if with_drift else 0.0
        if not abs(here + shift - guess) + abs(stretch) < STEP_LIMIT_S:
            return None
        R = Rotation.from_rotvec(step[:3]).as_matrix() @ R
        here, drift = here + shift, drift + stretch / half_s
        q_i, q_dot = moved()
        if abs(shift) + abs(stretch) < _CONVERGED_S:
            break
    residual = q_1 - q_i @ R.T
    rms_q = rms(q_1)
    return ClockFit(
        offset_s=float(here + drift * (middle_s - centre)),
        drift=float(drift),
        samples=part,
        half_s=float(half_s),
        R=R,
        residual=residual,
        rotated_rate=_determined(_turning(q_i @ R.T)),
        change=q_dot @ R.T,
        mismatch=rms(residual) / rms_q if rms_q > 0 else np.inf,
    )


def _smooth(omega: Array, rate_hz: float) -> Array:
    """Zero-phase low-pass of |H| = 1 / (1 + (f / cutoff)^2) along axis 0."""
    sections = butter(1, CUTOFF_HZ, fs=rate_hz, output="sos")
    padding = min(len(omega) - 1, math.ceil(6.0 * rate_hz / CUTOFF_HZ))
    return sosfiltfilt(sections, omega, axis=0, padlen=padding)


def _turning(rotated: Array) -> Array:
    """Derivative of R q_i by a rotation vector on the left, shape (Q, 3, 3)."""
    return -so3.skew(rotated)


def _determined(turning: Array) -> Array:
    """The same by the rotations that change something: none about a single axis of all motion."""
    values, axes = np.linalg.eigh(np.einsum("qik,qil->kl", turning, turning))
    return turning @ axes[:, values > 1e-12 * values[-1]]
