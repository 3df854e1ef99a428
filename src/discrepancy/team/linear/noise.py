"""Resolution of each sensor, estimated from the recording: rounding step, white noise, and torque chatter."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import butter, lfilter, periodogram, sosfiltfilt

from discrepancy.team.linear.signals import TEAM_PRE_HZ, TEAM_SMOOTH_HZ, Signals
from estimator.arrays import Array
from estimator.calibrate.driven import Drift
from estimator.calibrate.rules import ROCKING_S
from estimator.filtering import differentiate, low_pass
from estimator.quantisation import rounding_step
from estimator.recording.metadata import SENSORS
from mocobot_logs.resample_filter import Resampling

NOISE_SEED = 20250
"""Seed of the noise draws, fixed so that verdicts can be reproduced."""

MODEL_PHI_RAD, MODEL_THETA_RAD, MODEL_TAU_NM, MODEL_HZ = 2e-6, 7e-7, 3e-4, 100.0
"""Error of the model itself (soft rods, welds, integrator), as white noise of readings at ``MODEL_HZ``."""

NOISE_ABOVE_HZ = 25.0
"""Frequency above which nothing moves, so that signals contain noise only [Hz]. Chosen."""

NOISE_LINES, CHATTER_STEPS = 0.5, 10.0
"""Noise between spectral lines over total noise, below which the lines count as oscillation; amplitude of such lines
over the torque's noise, from which they count as chatter. Chosen."""


@dataclass(frozen=True, eq=False)
class Fast:
    """Content of every channel above 25 Hz, shape (3, N, 3) each: phi, theta, tau.

    Attributes:
        white: standard deviation of the white noise of a reading. It is robust against short disturbances, and against
            spectral lines if these dominate, as in a chattering joint.
        lines: root mean square of dominant spectral lines, otherwise 0.
        at_hz: frequency of the strongest line.
    """

    white: Array
    lines: Array
    at_hz: Array

    @classmethod
    def of(cls, signals: Signals) -> Fast:
        """Analyse one trial."""
        high, x = _high(signals), columns_of(signals)
        frequency, density = periodogram(x, signals.rate_hz, window="hann", detrend="linear", axis=0)
        fast = density[frequency > high]
        lines = np.sqrt(fast.sum(axis=0) * frequency[1])
        at_hz = frequency[frequency > high][fast.argmax(axis=0)]
        over_time, between_lines = _levels(signals)
        noise = between_lines >= NOISE_LINES * over_time
        white = np.where(noise, over_time, between_lines)
        each = (white, np.where(noise, 0.0, lines), at_hz)
        return cls(*(np.moveaxis(one.reshape(len(one), 3, 3), 1, 0) for one in each))

    def is_loud(self, step: Array) -> bool:
        """Whether a torque oscillates far above its noise, its rounding step and the model's error.

        Args:
            step: rounding steps, shape (3, N, 3).
        """
        quiet = np.maximum(np.maximum(step[2], self.white[2]), MODEL_TAU_NM)
        return bool(np.any(self.lines[2] > CHATTER_STEPS * quiet))


def native_hz(signals: Signals) -> Array:
    """Rate at which every robot's sensors were read [Hz], shape (N,)."""
    if signals.sampling is None:
        return np.full(signals.phi.shape[1], signals.rate_hz)
    return np.array([sampling.native_hz for sampling in signals.sampling])


def columns_of(signals: Signals) -> Array:
    """Readings of all sensors, shape (Q, N, 9)."""
    return np.concatenate([signals.phi, signals.theta, signals.tau], axis=2)


def _high(signals: Signals) -> float:
    """Frequency above which signals contain noise only [Hz]."""
    return float(min(NOISE_ABOVE_HZ, 0.4 * min(signals.rate_hz, *native_hz(signals))))


def _levels(signals: Signals) -> tuple[Array, Array]:
    """White noise of a reading with and without spectral lines, shape (N, 9) each.

    Resampling removes a part of the noise at high frequency. White noise through the same conversion gives that part.
    """
    rate_hz, x, high = signals.rate_hz, columns_of(signals), _high(signals)
    over_time, between_lines = _fast(high, x, rate_hz)
    if signals.sampling is None:
        share = np.sqrt(1.0 - high / (rate_hz / 2.0))
        return over_time / share, between_lines / share
    rng = np.random.default_rng(NOISE_SEED)
    for i, sampling in enumerate(signals.sampling):
        way = Resampling.of(sampling.later(float(signals.time[0])), rate_hz, len(x), rng)
        left = _fast(high, way(rng.standard_normal((len(way.instants), SENSORS))), rate_hz)
        over_time[i] /= np.median(left[0])
        between_lines[i] /= np.median(left[1])
    return over_time, between_lines


def _fast(high: float, x: Array, rate_hz: float) -> tuple[Array, Array]:
    """Root mean square above a frequency: robust and including spectral lines; and between the lines."""
    band = butter(4, high, btype="high", fs=rate_hz, output="sos")
    fast = np.asarray(sosfiltfilt(band, x, axis=0), dtype=np.float64)
    over_time = 1.4826 * np.median(np.abs(fast), axis=0)
    frequency, density = periodogram(fast, rate_hz, window="hann", axis=0)
    # The power of white noise is exponentially distributed: its median is ln 2 times its mean.
    level = np.median(density[frequency > high], axis=0) / np.log(2.0)
    return over_time, np.sqrt(level * (rate_hz / 2.0 - high))


def chattering(trials: Sequence[Signals]) -> tuple[str, ...]:
    """Note for the report if a torque chatters so much that the filters let the chatter pass.

    Args:
        trials: signals of every trial, with their cut-offs (``Noise.known_to``).
    """
    loud = [Fast.of(trial).lines[2] for trial in trials if trial.chatters]
    if not loud:
        return ()
    lines = np.max(loud, axis=0)
    robot, joint = np.unravel_index(int(np.argmax(lines)), lines.shape)
    return (
        f"The torque of driven joint {joint + 1} of robot {robot + 1} oscillates faster than "
        f"{NOISE_ABOVE_HZ:g} Hz, with {lines[robot, joint]:.2g} N m rms, as if its loop were unstable "
        "(mocobot inspect says at what frequency). The mean of what that does to torques and friction is in the model, "
        "as far as the samples tell it; what it does to readings that are not linear is in no cause.",
    )


ROLLERS_RAD, ROLLERS_HZ = 3e-5, (2.0, 6.0)
"""How the rollers of its wheels make a driving base rock, and at which frequencies. Measured on the shipped base."""


def _unit(x: Array) -> Array:
    return x / np.std(x)


def drifts(signals: Signals, rng: np.random.Generator, count: int) -> Array:
    """Draw what slip and rocking of driving bases add to their odometry, shape (Q, N, 6, count).

    The errors are those of ``estimator.calibrate.driven``: rotation [rad] and displacement [m] of each base.
    """
    of, (Q, N) = Drift(), signals.phi.shape[:2]
    white = rng.standard_normal((Q, N, 6, count))
    same = float(np.exp(-1.0 / (ROCKING_S * signals.rate_hz)))
    rock = np.asarray(lfilter([np.sqrt(1.0 - same**2)], [1.0, -same], white, axis=0))
    walk = np.cumsum(white, axis=0) / np.sqrt(signals.rate_hz)
    rolled = butter(2, ROLLERS_HZ, btype="band", fs=signals.rate_hz, output="sos")
    rock[:, :, :2] += (ROLLERS_RAD / of.rock_rad) * _unit(sosfiltfilt(rolled, white[:, :, :2], axis=0))
    sizes = np.array([of.rock_rad, of.rock_rad, of.slip_rad, of.slip_m, of.slip_m, of.rock_m])
    walks = np.array([False, False, True, True, True, False])
    return np.where(walks[:, None], walk, rock) * sizes[:, None]


QUIET_RAD_PER_S, QUIET_NM_PER_S, QUIET_HZ, NOISY_STEPS = 3e-4, 0.22, 6.0, 0.15
"""Noise of rates up to which the usual cut-off holds; least cut-off of noisier signals; noise over the rounding step
from which noise counts. Chosen."""

PHASE_TRAVEL = 4.0
"""Steps of travel after which a rounding error is drawn again. Chosen."""

SLOW_HZ, SMOOTHER_OCTAVES = 1.0, 3
"""Cut-off of the speed that gives the frequency of rounding stairs; octaves by which the signal's own cut-off may fall.
Chosen.
"""

CHATTER_OVER, CHATTER_RATE_SHARE = 2.0, 0.45
"""Cut-off over the frequency of chatter, and its limit over the sampling rate. Chosen: must pass the chatter."""

MODEL_BELOW_HZ, MODEL_ABOVE = 2.5, 0.2
"""Frequency up to which the model's own error lies, and its share above. Chosen."""


@dataclass(frozen=True, eq=False)
class Noise:
    """Resolution of every channel; arrays of shape (3, N, 3): phi, theta, tau.

    Attributes:
        step: rounding step, 0 for a continuous channel [rad, rad, N m].
        sigma: standard deviation of white noise of a reading before rounding [rad, rad, N m].
        chatters: whether a torque oscillates above 25 Hz.
    """

    step: Array
    sigma: Array
    chatters: bool = False

    @classmethod
    def of(cls, trials: list[Signals]) -> Noise:
        """Estimate the resolution of the sensors from some trials."""
        # Per trial, because the rounding grid may be offset differently.
        step = np.median([_steps(trial) for trial in trials], axis=0)
        fast = [Fast.of(trial) for trial in trials]
        white = np.sqrt(np.mean([one.white**2 for one in fast], axis=0))
        sigma = np.sqrt(np.maximum(white**2 - step**2 / 12.0, 0.0))
        return cls(step, sigma, any(one.is_loud(step) for one in fast))

    def known_to(self, signals: Signals) -> Signals:
        """Set the signals' cut-offs (``Signals.smooth_hz``, ``Signals.pre_hz``) according to their noise.

        Chatter must pass the filter: dry friction reverses with it, and then hardly resists slower motion.
        """
        noisy = self.sigma > NOISY_STEPS * self.step
        white = np.where(noisy, np.hypot(self.sigma, self.step / np.sqrt(12.0)), 0.0)
        rates = white * np.sqrt(signals.rate_hz / native_hz(signals))[:, None] * _rate_gain(signals.rate_hz)
        quiet = np.array([QUIET_RAD_PER_S, QUIET_RAD_PER_S, QUIET_NM_PER_S])
        # The noise of a rate grows with the cut-off to the power 3/2.
        less = (quiet[:, None, None] / np.maximum(rates, 1e-300)).clip(max=1.0) ** (2.0 / 3.0)
        smooth_hz = np.maximum(TEAM_SMOOTH_HZ * less, QUIET_HZ)
        fast = Fast.of(signals) if self.chatters else None
        if fast is None or not fast.is_loud(self.step):
            return replace(signals, smooth_hz=smooth_hz)
        most = CHATTER_RATE_SHARE * signals.rate_hz
        let_through = np.where(fast.lines > 0.0, np.minimum(CHATTER_OVER * fast.at_hz, most), 0.0)
        pre_hz = max(float(let_through.max()), TEAM_PRE_HZ)
        return replace(signals, smooth_hz=np.maximum(smooth_hz, let_through), pre_hz=pre_hz)

    def draws(self, signals: Signals, rng: np.random.Generator, count: int) -> Iterator[Signals]:
        """Draw the sensors' errors on a trial, as additions to its smooth signals.

        If the samples were resampled, errors are drawn at the original readings and pass through the same conversion.
        """
        smooth = _unrounded(signals, np.moveaxis(self.step, 0, 1).reshape(-1, SENSORS))
        at_a_time = 8  # to limit memory
        for first in range(0, count, at_a_time):
            size = min(at_a_time, count - first)
            ways = [_Way(smooth[:, i], signals, i, rng) for i in range(smooth.shape[1])]
            parts = [
                way.converted([self._errors(way.x, i, rng) for _ in range(size)])
                for i, way in enumerate(ways)
            ]
            for draw in np.moveaxis(np.array(parts), 0, 2):  # (Q, N, 9)
                phi, theta, tau = np.split(draw + _model_errors(smooth, signals.rate_hz, rng), 3, axis=2)
                yield Signals(signals.time, phi, theta, tau, signals.rate_hz)

    def _errors(self, x: Array, robot: int, rng: np.random.Generator) -> Array:
        """Draw the errors of one robot's readings with true values ``x``, shape (q, 9)."""
        return _read(x, self.step[:, robot].ravel(), self.sigma[:, robot].ravel(), rng)


class _Way:
    """One robot's signals at the original readings, and the conversion of errors from there to the samples.

    Attributes:
        x: signals at the readings, shape (q, 9).
    """

    def __init__(self, smooth: Array, signals: Signals, robot: int, rng: np.random.Generator) -> None:
        self._conversion: Resampling | None = None
        self.x = self._smooth = smooth
        if signals.sampling is not None:
            sampling, start_s = signals.sampling[robot], float(signals.time[0])
            self._conversion = Resampling.of(sampling.later(start_s), signals.rate_hz, len(smooth), rng)
            time = signals.time - start_s
            at = np.clip(self._conversion.instants, 0.0, time[-1])
            self.x = CubicSpline(time, smooth)(at)

    def converted(self, errors: list[Array]) -> Array:
        """Convert errors of the readings, (q, 9) each, to errors of the samples, shape (D, Q, 9).

        They include the interpolation error of the conversion, for example where samples are missing.
        """
        if self._conversion is None:
            return np.array(errors)
        made = self._conversion(np.concatenate([self.x, *errors], axis=1))
        made = np.moveaxis(made.reshape(len(made), -1, SENSORS), 1, 0)
        return made[1:] + (made[0] - self._smooth)


@cache
def _rate_gain(rate_hz: float) -> float:
    """Standard deviation of the rates that separate rest from motion, for unit white noise of every sample [1/s]."""
    impulse = np.zeros(int(4.0 * rate_hz) + 1)
    impulse[len(impulse) // 2] = 1.0
    smooth = low_pass(impulse, rate_hz, TEAM_SMOOTH_HZ)
    return float(np.linalg.norm(differentiate(smooth, rate_hz)))


def _read(x: Array, step: Array, sigma: Array, rng: np.random.Generator) -> Array:
    """Draw errors of readings of ``x`` with white noise and then rounding, for every channel in the last axis."""
    rounds = step > 0
    step = np.where(rounds, step, 1.0)
    x = x + step * _phase(x / step, rng)
    read = x + sigma * rng.standard_normal(x.shape)
    return np.where(rounds, np.round(read / step) * step, read) - x


def _model_errors(x: Array, rate_hz: float, rng: np.random.Generator) -> Array:
    """Draw the error of the model itself, shape (Q, N, 9): slow in motion, and constant at rest.

    A rounding error behaves the same way, so it serves as the model: its step gives the error's size. Only a small
    share of its fast part is kept.
    """
    floor = np.repeat([MODEL_PHI_RAD, MODEL_THETA_RAD, MODEL_TAU_NM], 3)
    step = floor * np.sqrt(12.0 * rate_hz / MODEL_HZ)
    errors = _read(x, step, np.zeros_like(step), rng)
    slow = low_pass(errors, rate_hz, MODEL_BELOW_HZ)
    return slow + MODEL_ABOVE * (errors - slow)


def _phase(x: Array, rng: np.random.Generator) -> Array:
    """Draw the offset of the true signal from its readings (in steps), which stays the same while the signal rests.

    Recorded readings lie on the rounding grid, but a resting encoder repeats one rounding error. The offset is
    piecewise linear over travel with a knot every ``PHASE_TRAVEL`` steps.
    """
    # Above two knots per sample nothing repeats.
    travel = np.minimum(np.abs(np.diff(x, axis=0, prepend=x[:1])), 2 * PHASE_TRAVEL)
    at = np.cumsum(travel, axis=0) / PHASE_TRAVEL
    low = np.floor(at).astype(np.intp)
    knots = rng.uniform(0.0, 2.0, (int(low.max()) + 2, *x.shape[1:]))
    return np.take_along_axis(knots, low, axis=0) * (1.0 - (at - low)) + np.take_along_axis(
        knots, low + 1, axis=0
    ) * (at - low)


def _unrounded(signals: Signals, step: Array) -> Array:
    """Estimate a smooth trajectory behind the readings, shape (Q, N, 9), with ``step`` (N, 9).

    Readings of a slow joint are stairs, which no fixed cut-off removes. The cut-off therefore falls with the frequency
    of the stairs where fewer than three of them fit into a period of ``TEAM_SMOOTH_HZ``.
    """
    x, rate_hz = columns_of(signals), signals.rate_hz
    slow = differentiate(low_pass(x, rate_hz, SLOW_HZ), rate_hz)
    stairs_hz = low_pass(np.abs(slow), rate_hz, SLOW_HZ) / np.where(step > 0, step, 1e-300)
    cutoffs = TEAM_SMOOTH_HZ * 0.5 ** np.arange(SMOOTHER_OCTAVES + 1)
    octave = np.log2(TEAM_SMOOTH_HZ / np.maximum(stairs_hz / 3.0, 1e-9)).clip(0.0, SMOOTHER_OCTAVES)
    octave[stairs_hz < SLOW_HZ] = 0.0  # at rest
    out = np.zeros_like(x)
    for k, cutoff in enumerate(cutoffs):
        weight = np.maximum(1.0 - np.abs(octave - k), 0.0)
        if weight.any():
            out += weight * low_pass(x, rate_hz, cutoff)
    return out


def _steps(signals: Signals) -> Array:
    """Rounding step of every channel, shape (3, N, 3)."""
    if signals.sampling is not None:
        return np.array([[sampling.steps_of(kind) for sampling in signals.sampling] for kind in range(3)])
    steps = np.apply_along_axis(rounding_step, 0, columns_of(signals))
    return np.moveaxis(steps.reshape(len(steps), 3, 3), 1, 0)
