"""Reduce the samples of a trial to nearly independent rows with known noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, correlate, find_peaks, sosfiltfilt
from scipy.sparse import csr_array

from estimator.arm.motion import COUNT
from estimator.arm.unit import Arms
from estimator.arrays import Array
from estimator.calibrate import rules
from estimator.filtering import MIN_SAMPLES, differentiate, low_pass
from estimator.quantisation import rounding_step
from estimator.recording.model import Recording
from estimator.rigid_team import robot_data
from estimator.so3 import cross, times


@dataclass(frozen=True, eq=False)
class Rows:
    """Thinned signals of one trial, and the linear map from them to rows.

    Attributes:
        s: filtered readings with rates and accelerations, shape (q, N, 21); (q, N, 30) with those of driving bases.
        operator: matrix from the q instants to rows, shape (n, q); rows in motion first.
        time: middle of every row [s], shape (n,).
        moving: number of rows in motion.
        gain: covariance of (angle, rate, acceleration) in a row in motion, for white angle noise of unit variance,
            shape (3, 3).
        length: number of samples that a row averages in a hold, shape (n,); 0 in motion.
        travel: path of each driven and gimbal joint during a row [rad], shape (n, N, 6).
        rate_hz: sampling rate.
        repeats: number of times that the same rounding errors occur in a periodic motion, shape (N, 9) or 1.
        scaled: of driving bases, change of pose, rate and acceleration by errors of scale of the odometry (yaw, x, y),
            by a displacement in proportion to acceleration, and by ``tilted_paths``, shape (q, N, 5, 9); None for bases
            that stand.
    """

    @property
    def driven(self) -> bool:
        """Whether the bases drive."""
        return self.scaled is not None

    s: Array
    operator: csr_array
    time: Array
    moving: int
    gain: Array
    length: NDArray[np.intp]
    travel: Array
    rate_hz: float
    repeats: Array | float
    scaled: Array | None = None

    def __call__(self, x: Array) -> Array:
        """Average samples into rows, shape (q, ...) -> (n, ...)."""
        return np.asarray(self.operator @ x.reshape(len(x), -1)).reshape(-1, *x.shape[1:])

    def take(self, chosen: NDArray[np.intp]) -> Rows:
        """Return some of the rows, in order, with the instants that they need."""
        operator = self.operator[chosen]
        needed = np.unique(operator.indices)
        return replace(
            self,
            s=self.s[needed],
            scaled=None if self.scaled is None else self.scaled[needed],
            operator=csr_array(operator[:, needed]),
            time=self.time[chosen],
            moving=int(np.sum(chosen < self.moving)),
            length=self.length[chosen],
            travel=self.travel[chosen],
        )

    @classmethod
    def of(cls, recording: Recording) -> Rows:
        """Divide a recording into rows: overlapping averages in motion, one mean per hold."""
        rate = recording.metadata.rate_hz
        cutoff = min(rules.PRE_HZ, 0.4 * rate)
        angles = np.concatenate([recording.phi, recording.theta], axis=2)
        s = np.empty((len(angles), recording.metadata.robots, COUNT))
        for first, x in ((0, recording.phi), (9, recording.theta)):
            value = low_pass(x, rate, cutoff)
            speed = differentiate(value, rate)
            for k, part in enumerate((value, speed, differentiate(speed, rate))):
                s[..., first + 3 * k : first + 3 * k + 3] = part
        s[..., 18:] = low_pass(recording.tau, rate, cutoff)
        scaled, joints = None, angles
        if recording.base is not None:
            base = with_rates(low_pass(recording.base, rate, cutoff), rate)
            s = np.concatenate([s, base], axis=2)
            paths = scaled_paths(base, rate), tilted_paths(s, recording.metadata.arms)[:, :, None]
            scaled = with_rates(np.concatenate(paths, axis=2), rate)
            joints = np.concatenate([angles, recording.base], axis=2)

        stride = max(1, round(rate / rules.SAMPLE_HZ))
        row_s = rules.ROW_S if recording.base is None else rules.DRIVEN_ROW_S
        kernel, spacing = _kernel(rate / stride, row_s)
        half = len(kernel) // 2
        trim = round(rules.TRIM_S * rate)
        holds, still = _holds(joints, rate, trim)
        at = np.arange(0, len(angles), stride)
        first, last = max(-(-trim // stride), half), min((len(angles) - trim) // stride, len(at) - half)
        rows: list[tuple[NDArray[np.intp], Array]] = []
        centres, length = [], []
        beside = round(rules.BESIDE_S * rate)
        for centre in range(first, last, spacing):
            # Next to a hold, the kernel would include the rounding error that the hold's own row already contains.
            if not still[max(0, at[centre] - beside) : at[centre] + beside + 1].any():
                rows.append((np.arange(centre - half, centre + half + 1), kernel))
                centres.append(at[centre])
                length.append(0)
        moving = len(rows)
        for start, stop in holds:
            inside = np.arange(-(-start // stride), (stop - 1) // stride + 1)
            rows.append((inside, np.full(len(inside), 1.0 / len(inside))))
            centres.append((start + stop - 1) // 2)
            length.append(stop - start)
        operator = csr_array(
            (
                np.concatenate([weights for _, weights in rows]) if rows else np.zeros(0),
                (
                    np.repeat(np.arange(len(rows)), [len(columns) for columns, _ in rows]),
                    np.concatenate([columns for columns, _ in rows]) if rows else np.zeros(0, dtype=int),
                ),
            ),
            shape=(len(rows), len(at)),
        )
        thin = s[at]
        speeds = np.abs(np.concatenate([thin[..., 3:6], thin[..., 12:15]], axis=2))
        count = np.array([len(columns) for columns, _ in rows], dtype=float)
        weights = abs(operator)
        travel = weights @ speeds.reshape(len(at), -1) / np.maximum(weights.sum(axis=1), 1e-300)[:, None]
        travel = np.asarray(travel).reshape(len(rows), -1, 6)
        span = np.where(np.array(length) > 0, count * stride / rate, row_s)
        return cls(
            thin,
            operator,
            recording.time[np.array(centres, dtype=int)] if rows else np.zeros(0),
            moving,
            _gain(rate, cutoff, stride, kernel),
            np.array(length, dtype=np.intp),
            travel * span[:, None, None],
            rate,
            scaled=None if scaled is None else scaled[at],
            repeats=_repeats(angles[trim : len(angles) - trim][~still[trim : len(angles) - trim]], rate),
        )


def with_rates(pose: Array, rate_hz: float) -> Array:
    """Append rates and accelerations, shape (Q, ..., 3) -> (Q, ..., 9)."""
    speed = differentiate(pose, rate_hz)
    return np.concatenate([pose, speed, differentiate(speed, rate_hz)], axis=-1)


def scaled_paths(base: Array, rate_hz: float) -> Array:
    """Return the change of poses (Q, N, 9) by ``Rows.scaled``, shape (Q, N, 4, 3)."""
    (x_dot, y_dot, turn), yaw = np.moveaxis(base[..., 3:6], -1, 0), base[..., 2]
    cos, sin, turned = np.cos(yaw), np.sin(yaw), yaw - yaw[0]
    along, across, none = cos * x_dot + sin * y_dot, cos * y_dot - sin * x_dot, np.zeros_like(yaw)
    rows = [[-turned * y_dot, turned * x_dot, turn]]
    rows += [[cos * along, sin * along, none], [-sin * across, cos * across, none]]
    path = np.cumsum(np.moveaxis(np.array(rows), (0, 1), (2, 3)), axis=0) / rate_hz
    return np.concatenate([path, base[:, :, None, 6:9] * [1.0, 1.0, 0.0]], axis=2)


def tilted_paths(s: Array, arms: Arms) -> Array:
    """Return how far the wrists move if bases tilt by 1 rad per N m of their load [m/(rad/(N m))], shape (Q, N, 3).

    Args:
        s: signals of arms and bases, shape (Q, N, 30).
        arms: the robots.
    """
    data = robot_data(s, arms)
    arm = data.h - s[..., COUNT : COUNT + 3] * [1.0, 1.0, 0.0]
    moment = -cross(arm, times(data.R_bi, data.wrench[..., 3:])) * [1.0, 1.0, 0.0]
    return cross(moment, arm - [0.0, 0.0, rules.FLOOR_M]) * [1.0, 1.0, 0.0]


def _repeats(angles: Array, rate_hz: float) -> Array | float:
    """Count how often readings (Q, N, 6) repeat exactly, for each angle and torque, shape (N, 9); 1 if they do not.

    If a commanded motion has a period of whole samples, its rounding errors repeat and do not average out. Candidate
    periods are the peaks of one joint's autocorrelation.
    """
    shortest = round(rules.SHORTEST_PERIOD_S * rate_hz)
    if len(angles) < 2 * shortest:
        return 1.0
    x = angles[:, 0, 0] - angles[:, 0, 0].mean()
    alike = correlate(x, x, method="fft")[len(x) - 1 :] / np.arange(len(x), 0, -1)
    lags = find_peaks(alike[: len(x) - shortest])[0]
    lags = lags[lags >= shortest]
    best = lags[np.argsort(-alike[lags])[: rules.PERIODS]]
    lags = np.union1d(best, lags[alike[lags] > 0.9 * alike[best].max(initial=0.0)][: rules.PERIODS])
    shares = np.array([np.mean(np.abs(angles[lag:] - angles[:-lag]) < 1e-9, axis=0) for lag in lags])
    if not len(lags) or shares.mean(axis=(1, 2)).max() < rules.REPEATED:
        return 1.0
    # The shortest candidate period with at least 80 % of the largest share of repeats.
    first = np.argmax(shares > 0.8 * shares.max(axis=0), axis=0)
    again = 1.0 + np.take_along_axis(shares, first[None], axis=0)[0] * (len(angles) / lags[first] - 1.0)
    return np.concatenate([again, again[:, :3]], axis=1)


def _kernel(rate_hz: float, row_s: float) -> tuple[Array, int]:
    """Return the weights of a row in motion, with sum 1, and the number of instants between rows.

    The kernel is a root-raised-cosine (the square root of Nyquist's criterion: H. Nyquist, Certain Topics in Telegraph
    Transmission Theory, 1928). White noise in different rows is then uncorrelated, so the rows' covariance is valid
    for slowly varying quantities. With a windowed sinc, neighbouring rows correlate by an eighth, and the claimed
    precision is a seventh too high.
    """
    spacing, b = max(1, round(row_s * rate_hz)), rules.ROLL_OFF
    half = rules.LOBES * spacing
    # The offset of 1e-6 avoids the removable singularities at 0 and 1 / (4 b).
    x = np.arange(-half, half + 1) / spacing + 1e-6
    weights = np.sin(np.pi * x * (1.0 - b)) + 4.0 * b * x * np.cos(np.pi * x * (1.0 + b))
    weights /= np.pi * x * (1.0 - (4.0 * b * x) ** 2)
    weights += weights[::-1]
    return weights / weights.sum(), spacing


def _gain(rate_hz: float, cutoff_hz: float, stride: int, kernel: Array) -> Array:
    """Return a row's response to a unit impulse in one sample, squared and summed over all samples, shape (3, 3)."""
    half = max(round(1.5 * rate_hz), MIN_SAMPLES)
    impulse = np.zeros(2 * half + 1)
    impulse[half] = 1.0
    value = low_pass(impulse, rate_hz, cutoff_hz)
    speed = differentiate(value, rate_hz)
    spread = np.zeros(stride * (len(kernel) - 1) + 1)
    spread[::stride] = kernel
    chains = np.array([np.convolve(x, spread) for x in (value, speed, differentiate(speed, rate_hz))])
    # Values and accelerations are even, rates odd, so rates do not correlate with the others.
    return chains @ chains.T


def _holds(angles: Array, rate_hz: float, trim: int) -> tuple[list[tuple[int, int]], NDArray[np.bool_]]:
    """Return spans of samples in which no joint of any robot moves, and a mask of the samples at rest, shape (Q,)."""
    flat = angles.reshape(len(angles), -1)
    speed = np.abs(differentiate(low_pass(flat, rate_hz, rules.STILL_HZ), rate_hz)).max(axis=1)
    still = speed < rules.STILL_RADPS
    still[:trim] = still[len(still) - trim :] = False
    edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]]).astype(int)))
    settle, shortest = round(rules.SETTLING_S * rate_hz), round(rules.SHORTEST_HOLD_S * rate_hz)
    spans = [(start + settle, stop - settle) for start, stop in edges.reshape(-1, 2)]
    return [(start, stop) for start, stop in spans if stop - start >= shortest], still


class Resolution(NamedTuple):
    """Sensor resolution according to one recording; arrays of shape (N, 9): phi, theta, tau.

    Attributes:
        step: rounding step, 0 for a continuous channel [rad, N m].
        white: standard deviation of all white noise in a sample, including rounding [rad, N m].
        share: as in ``Sensing``, shape (N, 1).
    """

    step: Array
    white: Array
    share: Array

    @classmethod
    def of(cls, recording: Recording) -> Resolution:
        """Estimate the resolution from one recording."""
        step, white = _steps(recording), _white(recording)
        if recording.metadata.sampling is None:
            # The rounding ripple of a slow joint is not noise: without noise, no reading steps back and forth.
            to_and_fro = _to_and_fro(recording, step)
            noise = np.where(
                to_and_fro < rules.TO_AND_FRO, rules.NOISE_TO_AND_FRO * to_and_fro * step, np.inf
            )
            white = np.minimum(white, np.sqrt(noise**2 + step**2 / 12.0))
        return cls(step, white, _share(recording))


@dataclass(frozen=True, eq=False)
class Sensing:
    """Resolution of every channel; arrays of shape (N, 9): phi, theta, tau.

    Attributes:
        step: rounding step, 0 for a continuous channel [rad, N m].
        sigma: standard deviation of the white noise of a sample before rounding [rad, N m].
        share: sampling rate over reading rate, shape (N, 1) or 1. Resampling multiplies the variance of white reading
            errors by this factor, at the frequencies within a row.
    """

    step: Array
    sigma: Array
    share: Array | float = 1.0

    @classmethod
    def of(cls, recordings: Sequence[Recording]) -> Sensing:
        """Pool the resolution over recordings of the same robots that were read and converted alike."""
        return cls.pooled([Resolution.of(recording) for recording in recordings])

    @classmethod
    def pooled(cls, found: Sequence[Resolution]) -> Sensing:
        """Pool the resolutions of several recordings."""
        step = np.median([one.step for one in found], axis=0)
        white = np.sqrt(np.mean([one.white**2 for one in found], axis=0))
        share = np.mean([one.share for one in found], axis=0)
        return cls(step, np.sqrt(np.maximum(white**2 - share * step**2 / 12.0, 0.0)), share)

    @classmethod
    def of_each(cls, found: Sequence[Resolution]) -> list[Sensing]:
        """Return the resolution for each recording, pooled over recordings that were read and converted alike."""
        rates = [tuple(np.round(one.share.ravel(), 3)) for one in found]
        pools = {
            rate: cls.pooled([one for one, its in zip(found, rates, strict=True) if its == rate])
            for rate in set(rates)
        }
        return [pools[rate] for rate in rates]

    def variances(self, rows: Rows) -> tuple[Array, Array]:
        """Return the variance of one sample in motion, and of a row's mean in a hold, shape (n, N, 9) each.

        A joint that makes few steps during a row has few independent rounding errors. A joint at rest has one, unless
        noise dithers the reading.
        """
        least = np.repeat([rules.PHI_FLOOR_RAD, rules.THETA_FLOOR_RAD, rules.TORQUE_FLOOR_NM], 3) ** 2
        floor = least * rows.rate_hz / rules.FLOOR_HZ
        rounding, noise = self.step**2 / 12.0, self.sigma**2
        step = np.maximum(self.step, 1e-300)
        dithered = self.sigma > rules.DITHER * step * np.sqrt(self.share)
        # Effective number of independent readings in a row in motion.
        samples = 1.0 / rows.gain[0, 0] / self.share
        way = np.concatenate([rows.travel, np.full((*rows.travel.shape[:2], 3), np.inf)], axis=2)
        independent = np.clip(1.0 + way / step, 1.0, samples)
        repeats = np.where(dithered, 1.0, rows.repeats * samples / independent)
        moving = noise + rounding * self.share * repeats + floor
        long = np.maximum(rows.length, 1)[:, None, None]
        lasting = np.clip(1.0 + way / step, 1.0, long)
        lasting[..., 6:] = 1.0
        held = noise / long + rounding / np.where(dithered, long, lasting) + rules.AT_REST**2 * least
        return moving, np.broadcast_to(held, moving.shape)


def _columns(recording: Recording) -> Array:
    return np.concatenate([recording.phi, recording.theta, recording.tau], axis=2)


def _steps(recording: Recording) -> Array:
    told = recording.metadata.sampling
    if told is not None:
        return np.array([np.concatenate([one.steps_of(kind) for kind in range(3)]) for one in told])
    return np.apply_along_axis(rounding_step, 0, _columns(recording))


def _to_and_fro(recording: Recording, step: Array) -> Array:
    """Return the share of slow changes (one step at most) that the next change reverses, (N, 9); 1 if few are slow."""
    change = np.rint(np.diff(_columns(recording), axis=0) / np.where(step > 0, step, np.inf))
    slow = np.all([np.abs(change[1:]) <= 1, np.abs(change[:-1]) <= 1], axis=0)
    back, count = np.sum(slow & (change[1:] * change[:-1] < 0), axis=0), np.sum(slow, axis=0)
    return np.where((count < rules.LEAST_SLOW) | (step == 0), 1.0, back / np.maximum(count, 1))


def _share(recording: Recording) -> Array:
    """Return the sampling rate over each robot's reading rate, shape (N, 1)."""
    told, rate = recording.metadata.sampling, recording.metadata.rate_hz
    if told is None:
        return np.ones((recording.metadata.robots, 1))
    return np.array([[rate / one.native_hz] for one in told])


def _white(recording: Recording) -> Array:
    """Return the standard deviation of all white noise in a sample, including rounding, shape (N, 9).

    It is measured in the band above all motion. Converted samples have little noise there, so the highest frequencies
    that the conversion passes are used instead.
    """
    told, rate = recording.metadata.sampling, recording.metadata.rate_hz
    if told is None:
        edges: tuple[float, ...] = (min(rules.NOISE_ABOVE_HZ, 0.4 * rate),)
    else:
        top = min(rules.PASSED * rate, 0.35 * min(one.native_hz for one in told))
        edges = 0.6 * top, top
    band = butter(4, edges if told else edges[0], btype="band" if told else "high", fs=rate, output="sos")
    left = sosfiltfilt(band, _columns(recording), axis=0)
    impulse = np.zeros(2 * round(2.0 * rate) + 1)
    impulse[len(impulse) // 2] = 1.0
    kept = np.sum(sosfiltfilt(band, impulse) ** 2)
    return 1.4826 * np.median(np.abs(left), axis=0) / np.sqrt(kept)
