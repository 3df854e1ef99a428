"""Estimate the offset and drift between the robots' clocks from the motion of a shared payload.

All grasps of a rigid payload have the same angular velocity, expressed in different frames. The gimbal angles of each
robot give it in {i} on that robot's clock. The time shift that aligns two robots is the difference of their clocks.
Correlating |omega|, which is equal in all frames, finds candidate shifts (``likely_lags``). A fit of the whole vectors
then refines them (``fit_clock``). With 16-bit encoders the standard error is 4 us and 0.1 ppm for a random trial of
payload (a), and 1.2 us for a periodic one. With |omega| alone it is 1.3 and 1.8 times larger.

A positive offset means that a clock is ahead: **stamp = true time + offset + drift (true time - middle)**. True time
is the clock of robot 1. A log that stamps a sample taken at t - delay with t has an offset of +delay.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import BSpline, make_interp_spline
from scipy.signal import butter, correlate, sosfiltfilt
from scipy.spatial.transform import Rotation

from estimator import so3
from estimator.arm.dynamics import rate_matrix
from estimator.arrays import Array
from estimator.estimate.grasps import pair_rotation
from estimator.estimate.uncertainty import StepReport, judge, window_covariance, window_normals, windows
from estimator.filtering import differentiate
from estimator.statistics import rms

# With q_1(t) and q_i(s) the filtered angular velocities by the stamps of either robot, the residuals are
#
#     e(t) = q_1(t) - (1 + drift) R_1i q_i(s(t)),    s(t) = t + offset + drift (t - middle),
#
# with R_1i also unknown; a fast clock makes rates appear small. The filter commutes with R_1i, so it affects both
# signals equally. A quintic spline interpolates q_i; far below half the sampling rate it is the band-limited signal.

CUTOFF_HZ = 0.7
"""Cut-off of the first-order low-pass, run forward and backward. White encoder noise grows in proportion to frequency
in the rates; from the cut-off on, the filter compensates this growth. The motion of a payload ends below 1 Hz. Sharper
filters at 1 to 3 Hz give 1.0 to 1.6 times the scatter."""
TRIM_S = 2.0
"""Time dropped at both ends of a stream because of filter transients [s]."""
STEP_LIMIT_S = 0.5
"""Largest distance of a fit from its initial guess; beyond it, the fit has diverged [s]."""
_ITERATIONS = 20
_CONVERGED_S = 1e-10
_RATE_HZ = 25.0


class Rates:
    """Filtered angular velocity of one robot's grasp on its own clock.

    Attributes:
        rate_hz: sampling rate of ``time`` and ``q``, about 25 Hz; the filter leaves little above half of that.
        time: stamps without filter transients [s], shape (Q,).
        q: angular velocity in {i} [rad/s], shape (Q, 3).
        spline: interpolation of the angular velocity through all recorded samples.
        change: derivative of ``spline`` [rad/s^2].
    """

    def __init__(self, theta: Array, start_s: float, rate_hz: float) -> None:
        """Take gimbal angles [rad], shape (Q, 3), well over 2 ``TRIM_S`` seconds long."""
        omega = np.einsum("qij,qj->qi", rate_matrix(theta), differentiate(theta, rate_hz))
        keep = slice(round(TRIM_S * rate_hz), len(theta) - round(TRIM_S * rate_hz))
        time, q = start_s + np.arange(len(theta))[keep] / rate_hz, _smooth(omega, rate_hz)[keep]
        every = max(1, int(rate_hz / _RATE_HZ))
        self.rate_hz, self.time, self.q = rate_hz / every, time[::every], q[::every]
        self.spline: BSpline = make_interp_spline(time, q, k=5)
        self.change: BSpline = self.spline.derivative()


@dataclass(frozen=True)
class ClockFit:
    """Least-squares fit of a clock to a span of samples of robot 1.

    Attributes:
        offset_s, drift: s = t + offset + drift (t - middle) [s], [-].
        samples: span of robot 1's samples in the fit.
        half_s: half the length of the span [s].
        R: R_1i.
        residual: e, shape (Q, 3) [rad/s].
        rotated_rate: columns of J for the rotation, shape (Q, 3, K), without directions that have no effect.
        change: R_1i dq_i/ds [rad/s^2], shape (Q, 3): minus the derivative of e with respect to the offset.
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
    """Fit a clock by Gauss-Newton; return None if it diverges or less than half of the samples overlap.

    Args:
        first, other: robots 1 and i.
        part: samples of robot 1 to use, if robot i has samples at those instants.
        middle_s: instant of robot 1 to which ``offset_s`` refers [s].
        offset_s, drift: initial guess.
        with_drift: whether to estimate the drift rather than hold it.
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
    # The offset at the centre of the samples is uncorrelated with the drift.
    guess = here = offset_s + drift * (centre - middle_s)

    def moved() -> tuple[Array, Array]:
        """Return q_i and its derivative at robot 1's instants, per second of robot 1."""
        at = time + here + drift * (time - centre)
        return (1.0 + drift) * other.spline(at), (1.0 + drift) * other.change(at)

    q_i, q_dot = moved()
    R = pair_rotation(q_1, q_i)
    for _ in range(_ITERATIONS):
        change = q_dot @ R.T
        columns = [
            -so3.skew(q_i @ R.T),
            change[..., None],
        ]  # derivatives with respect to a left rotation vector and the offset
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
        rotated_rate=_determined(-so3.skew(q_i @ R.T)),
        change=q_dot @ R.T,
        mismatch=rms(residual) / rms_q if rms_q > 0 else np.inf,
    )


def _smooth(omega: Array, rate_hz: float) -> Array:
    """Apply a zero-phase low-pass with |H| = 1 / (1 + (f / cutoff)^2) along axis 0."""
    sections = butter(1, CUTOFF_HZ, fs=rate_hz, output="sos")
    padding = min(len(omega) - 1, math.ceil(6.0 * rate_hz / CUTOFF_HZ))
    return sosfiltfilt(sections, omega, axis=0, padlen=padding)


def _determined(turning: Array) -> Array:
    """Keep the rotation derivatives with an effect: motion about a single axis leaves one direction without any."""
    values, axes = np.linalg.eigh(np.einsum("qik,qil->kl", turning, turning))
    return turning @ axes[:, values > 1e-12 * values[-1]]


CANDIDATES = 6
_AS_HIGH = 0.02
_MIN_OVERLAP = 0.5  # of the shorter signal
_STILL = 1e-9  # variance, relative to the largest, below which it is rounding error of the transforms


def likely_lags(a: Array, b: Array, least: int, largest: int, near: float) -> list[int]:
    """Return the lags L at which b[n + L] correlates best with a[n], the best first.

    The correlation coefficient at each lag uses only the overlapping samples (Padfield, "Masked object registration in
    the Fourier domain", IEEE Trans. Image Processing 2012, in one dimension). Candidates are its highest local maxima.
    Maxima within 2 % of each other are sorted by distance from ``near``, so that periodic motion does not hide the
    likely lag.

    Args:
        a, b: samples at one rate, shapes (Q,) and (P,).
        least, largest: range of the lags.
        near: lag of equal clocks.
    """
    lags = np.arange(1 - len(a), len(b))
    rho = _correlation(a, b)
    rho[(lags < least) | (lags > largest)] = -np.inf
    padded = np.concatenate([[-np.inf], rho, [-np.inf]])
    peaks = np.flatnonzero((rho > padded[:-2]) & (rho >= padded[2:]) & (rho > 0.0))
    grade = np.floor((rho[peaks].max(initial=0.0) - rho[peaks]) / _AS_HIGH)
    best = peaks[np.lexsort((np.abs(lags[peaks] - near), grade))][:CANDIDATES]
    return [int(lag) for lag in lags[best]]


def _correlation(a: Array, b: Array) -> Array:
    """Return the correlation coefficient at lags 1 - Q to P - 1; -inf if too little overlaps or a signal rests."""
    a, b = a - a.mean(), b - b.mean()
    one_a, one_b = np.ones_like(a), np.ones_like(b)

    def sums(of_b: Array, of_a: Array) -> Array:
        return correlate(of_b, of_a, mode="full", method="fft")

    count = np.rint(sums(one_b, one_a))
    count[count < 1] = 1.0
    sum_a, sum_b = sums(one_b, a), sums(b, one_a)
    var_a = sums(one_b, a**2) - sum_a**2 / count
    var_b = sums(b**2, one_a) - sum_b**2 / count
    moving = (var_a > _STILL * var_a.max()) & (var_b > _STILL * var_b.max())
    usable = moving & (count >= _MIN_OVERLAP * min(len(a), len(b)))
    rho = np.full(len(count), -np.inf)
    both = sums(b, a) - sum_a * sum_b / count
    rho[usable] = both[usable] / np.sqrt(var_a[usable] * var_b[usable])
    return rho


MAX_OFFSET_S = 30.0
NUMBERS = ("offset_s", "drift", "covariance", "mismatch", "repeats_s")
"""Numeric fields of each clock."""
MATCH = 1.0 / 3.0
"""Residual over motion (rms) above which two robots do not share one angular velocity at any time shift."""
_SHORTEST_S = 4.0  # of overlapping motion
_PIECE_S, _GROWTH = 120.0, 3.0
_SAME_S = 0.1
_RIVAL = 1.25  # a shift with up to this multiple of the least mismatch is equally good
_RATE_FLOOR, _TRANSIENTS = 1e-7, 1e-5
"""Smallest significant change of the angular velocity: rounding error [rad/s^2], and filter transients as a share of
the total change."""


@dataclass(frozen=True)
class ClockEstimate:
    """Clocks of N robots relative to robot 1, whose own values are zero.

    Attributes:
        middle_s: instant of robot 1 at which the offsets hold, relative to the origin of the stamps [s].
        offset_s: stamp minus true time at ``middle_s`` [s], shape (N,); NaN if undetermined.
        drift: seconds gained per second, shape (N,); NaN if the offset is undetermined, 0 if only the drift is.
        covariance: of (offset, drift), shape (N, 2, 2); NaN for an undetermined offset, infinite for an undetermined
            drift.
        mismatch: rms of the remaining angular velocity difference over rms motion, shape (N,).
        repeats_s: for periodic motion, the smallest shift that fits equally well [s]; the offset is known up to
            multiples of it. NaN otherwise, shape (N,).
        reports: excitation of the offset and drift of robots 2 to N; a robot without comparable data has none.
        why_not: reason why the offset of each robot is undetermined, or None.
    """

    middle_s: float
    offset_s: Array
    drift: Array
    covariance: Array
    mismatch: Array
    repeats_s: Array
    reports: tuple[StepReport, ...]
    why_not: tuple[str | None, ...]

    @property
    def offset_se_s(self) -> Array:
        """Standard errors of the offsets [s], shape (N,)."""
        return np.sqrt(self.covariance[:, 0, 0])

    @property
    def drift_se(self) -> Array:
        """Standard errors of the drifts, shape (N,)."""
        return np.sqrt(self.covariance[:, 1, 1])

    @property
    def determined(self) -> bool:
        """Whether all offsets are determined."""
        return not any(self.why_not)

    def stamps(self, robot: int, time_s: ArrayLike) -> Array:
        """Convert times of robot 1 [s] to stamps of ``robot`` (from 0) [s], same shape."""
        time_s = np.asarray(time_s, dtype=float)
        return time_s + self.offset_s[robot] + self.drift[robot] * (time_s - self.middle_s)


def estimate_clocks(
    theta: Sequence[Array], start_s: ArrayLike, rate_hz: float, max_offset_s: float = MAX_OFFSET_S
) -> ClockEstimate:
    """Estimate the offset and drift of every robot's clock relative to that of robot 1.

    Args:
        theta: gimbal angles (theta_z, theta_y, theta_x) of each robot at its own instants [rad], N arrays of shape
            (Q_i, 3).
        start_s: first stamp of each robot relative to one common origin [s], shape (N,).
        rate_hz: sampling rate on each robot's own clock [Hz].
        max_offset_s: largest magnitude of an offset [s].

    Returns:
        The estimate. If the motion does not determine an offset, it is NaN and ``why_not`` gives the reason.
    """
    starts = np.asarray(start_s, dtype=float)
    too_short = [len(x) < (2 * TRIM_S + _SHORTEST_S) * rate_hz for x in theta]
    middle_s = float(starts[0] + (len(theta[0]) - 1) / rate_hz / 2)
    results = []
    first = None if too_short[0] else Rates(theta[0], starts[0], rate_hz)
    for i in range(1, len(theta)):
        if first is None or too_short[i]:
            seconds = min(len(theta[0]), len(theta[i])) / rate_hz
            results.append(_unknown(f"{seconds:.3g} s of samples are too short"))
        else:
            results.append(_pair(first, Rates(theta[i], starts[i], rate_hz), i + 1, middle_s, max_offset_s))
    return _relative_to_first(middle_s, results)


def unknown_clocks(robots: int, middle_s: float, why: str) -> ClockEstimate:
    """Return undetermined clocks of N robots, with the reason ``why``.

    ``middle_s`` is an instant of robot 1, relative to the origin of the stamps [s].
    """
    return _relative_to_first(middle_s, [_unknown(why)] * (robots - 1))


def _relative_to_first(middle_s: float, others: Sequence[_Clock]) -> ClockEstimate:
    clocks = [_Clock(0.0, 0.0, np.zeros((2, 2)), 0.0, np.nan, None, None), *others]
    return ClockEstimate(
        middle_s,
        **{name: np.array([getattr(clock, name) for clock in clocks]) for name in NUMBERS},
        reports=tuple(clock.report for clock in clocks if clock.report is not None),
        why_not=tuple(clock.why_not for clock in clocks),
    )


class _Clock(NamedTuple):
    offset_s: float
    drift: float
    covariance: Array
    mismatch: float
    repeats_s: float
    report: StepReport | None
    why_not: str | None


def _unknown(why: str, mismatch: float = np.nan, report: StepReport | None = None) -> _Clock:
    return _Clock(np.nan, np.nan, np.full((2, 2), np.nan), mismatch, np.nan, report, why)


def _pair(first: Rates, other: Rates, robot: int, middle_s: float, max_offset_s: float) -> _Clock:
    piece = _liveliest(first)
    found = _search(first, other, piece, middle_s, max_offset_s)
    if found is None:
        return _unknown("the payload hardly turns, or the logs hardly overlap")
    fit, repeats_s = found
    report = _excitation(first, fit, robot)
    if not report.rank:
        return _unknown(report.weak[0].reason, fit.mismatch, report)
    if fit.mismatch > MATCH:
        why = (
            f"no shift makes the robots turn alike: {100 * fit.mismatch:.0f} % of the motion differ, "
            f"{100 * MATCH:.0f} % are allowed"
        )
        return _unknown(why, fit.mismatch, report)
    while piece != slice(0, len(first.time)):
        piece = _grown(piece, len(first.time))
        grown = fit_clock(first, other, piece, middle_s, fit.offset_s, fit.drift)
        if grown is None or grown.mismatch > MATCH:
            return _unknown("the clocks do not run evenly against each other", fit.mismatch, report)
        fit = grown
    report = _excitation(first, fit, robot)
    with_drift = report.determined
    if not with_drift:
        # A short motion determines the offset alone, with zero drift, unless a rotation has the same effect.
        alone = _excitation(first, fit, robot, with_drift=False)
        if not alone.determined:
            return _unknown(alone.weak[0].reason, fit.mismatch, report)
        fit = fit_clock(first, other, piece, middle_s, fit.offset_s, with_drift=False) or fit
    return _Clock(
        fit.offset_s,
        fit.drift if with_drift else 0.0,
        _covariance(first, fit, middle_s, with_drift=with_drift),
        fit.mismatch,
        repeats_s,
        report,
        None,
    )


def _liveliest(first: Rates) -> slice:
    """Return the span of robot 1 in which its angular velocity changes most."""
    length, samples = round(_PIECE_S * first.rate_hz), len(first.time)
    if samples <= length:
        return slice(0, samples)
    energy = np.concatenate([[0.0], np.cumsum(np.sum(first.change(first.time) ** 2, axis=1))])
    start = int(np.argmax(energy[length:] - energy[:-length]))
    return slice(start, start + length)


def _grown(piece: slice, samples: int) -> slice:
    more = round((_GROWTH - 1) / 2 * (piece.stop - piece.start))
    return slice(max(0, piece.start - more), min(samples, piece.stop + more))


def _search(
    first: Rates, other: Rates, piece: slice, middle_s: float, max_offset_s: float
) -> tuple[ClockFit, float] | None:
    """Return the best fit of a span and the smallest other shift that fits equally well, or NaN."""
    a, b = (np.linalg.norm(q, axis=1) for q in (first.q[piece], other.q))
    apart_s, step_s = other.time[0] - first.time[piece][0], 1.0 / first.rate_hz
    least, largest = ((bound - apart_s) / step_s for bound in (-max_offset_s, max_offset_s))
    lags = likely_lags(a, b, math.ceil(least), math.floor(largest), near=-apart_s / step_s)
    fits: list[ClockFit] = []
    # Also try equal clocks, which are likely a priori.
    for offset_s in [*(apart_s + lag * step_s for lag in lags), 0.0]:
        fit = fit_clock(first, other, piece, middle_s, offset_s)
        if fit is not None and all(abs(fit.offset_s - f.offset_s) > _SAME_S for f in fits):
            fits.append(fit)
    if not fits:
        return None
    least = min(fit.mismatch for fit in fits)
    as_good = [fit for fit in fits if fit.mismatch <= _RIVAL * least + 1e-6]
    best = min(as_good, key=lambda fit: abs(fit.offset_s))
    others = [abs(fit.offset_s - best.offset_s) for fit in as_good if fit is not best]
    return best, min(others, default=np.nan)


def _excitation(first: Rates, fit: ClockFit, robot: int, *, with_drift: bool = True) -> StepReport:
    """Judge how strongly offset and drift change the residual, beyond the effect of a rotation, against noise."""
    time = first.time[fit.samples]
    lever = ((time - (time[0] + time[-1]) / 2) / fit.half_s)[:, None]
    parts = [fit.change, lever * fit.change] if with_drift else [fit.change]
    columns = np.stack(parts, axis=-1).reshape(fit.change.size, -1)
    turning = fit.rotated_rate.reshape(len(columns), -1)
    if turning.shape[1]:
        columns = columns - turning @ np.linalg.lstsq(turning, columns, rcond=None)[0]
    disagreement = first.change(time) - fit.change
    return judge(
        f"clock of robot {robot}",
        ("offset", "drift")[: columns.shape[1]],
        columns.T @ columns / len(time),
        rms(disagreement),
        unit="rad/s^2",
        reason="the payload's angular velocity changes too little, too evenly or not alike at both grasps",
        floor=max(_RATE_FLOOR, _TRANSIENTS * float(np.linalg.norm(fit.change)) / len(time) ** 0.5),
    )


def _covariance(first: Rates, fit: ClockFit, middle_s: float, *, with_drift: bool) -> Array:
    """Return the covariance (2, 2) of the offset at ``middle_s`` and the drift."""
    time = first.time[fit.samples]
    centre = (time[0] + time[-1]) / 2
    lever = ((time - centre) / fit.half_s)[:, None, None]
    change = fit.change[..., None]
    J = np.concatenate([fit.rotated_rate, change] + ([lever * change] if with_drift else []), axis=-1)
    size = np.sqrt(np.mean(J**2, axis=(0, 1)))
    parts = windows(len(time), first.rate_hz)
    covariance = window_covariance(*window_normals(J / size, fit.residual, parts)) / np.outer(size, size)
    K = fit.rotated_rate.shape[-1]
    if not with_drift:
        return np.array([[covariance[K, K], 0.0], [0.0, np.inf]])
    to_middle = np.array([[1.0, (middle_s - centre) / fit.half_s], [0.0, 1.0 / fit.half_s]])
    return to_middle @ covariance[K:, K:] @ to_middle.T
