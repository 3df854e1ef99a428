"""What every channel has above all motion: white noise, and the lines of a loop that chatters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import butter, periodogram, sosfiltfilt

from discrepancy.team.linear.signals import Signals
from estimator.arrays import Array
from estimator.recording.sampling import SENSORS
from mocobot_logs.resample_filter import Resampling

NOISE_SEED = 20250
"""Of these draws. Chosen: any will do; fixed, so that a verdict can be had again."""

MODEL_PHI_RAD, MODEL_THETA_RAD, MODEL_TAU_NM, MODEL_HZ = 2e-6, 7e-7, 3e-4, 100.0
"""What the model itself leaves beside any sensor, as noise of readings at ``MODEL_HZ``; as much in a band at any
other rate. Measured: what soft rods, welds and the integrator leave of trials with ideal sensors weighs as much as 1 to
3 urad of phi below 0.5 Hz and a third of that to 2 Hz, 0.1 to 2 urad of theta, and, at the motion's own frequencies,
0.1 to 0.2 mN m in random trials."""

NOISE_ABOVE_HZ = 25.0
"""Where nothing moves, so that what is there is noise. Chosen."""

NOISE_LINES, CHATTER_STEPS = 0.5, 10.0
"""Share of the amplitude there that is between the lines, below which the lines are no noise: a joint that chatters.
And over the torque's step, from which on that is worth a note and, where it is over the noise as well, wider filters.
Chosen: healthy joints have no lines, and what a tenth of a newton metre does is 0.04 mN, as it goes with the square."""


@dataclass(frozen=True, eq=False)
class Fast:
    """What every channel has above 25 Hz, shape (3, N, 3) each: phi, theta, tau.

    Attributes:
        white: standard deviation of white noise of a reading. Robust against moments, and against lines where these are
            most of it: a joint that chatters.
        lines: root mean square where it is lines and no noise, otherwise 0.
        at_hz: of the strongest line.
    """

    white: Array
    lines: Array
    at_hz: Array

    @classmethod
    def of(cls, signals: Signals) -> Fast:
        """Of one trial."""
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
        """Whether a torque oscillates by much more than its noise, its step and what the model leaves.

        Args:
            step: rounding steps, shape (3, N, 3).
        """
        quiet = np.maximum(np.maximum(step[2], self.white[2]), MODEL_TAU_NM)
        return bool(np.any(self.lines[2] > CHATTER_STEPS * quiet))


def native_hz(signals: Signals) -> Array:
    """Rate of every robot's readings [Hz], shape (N,)."""
    if signals.sampling is None:
        return np.full(signals.phi.shape[1], signals.rate_hz)
    return np.array([sampling.native_hz for sampling in signals.sampling])


def columns_of(signals: Signals) -> Array:
    """The sensors' channels of all robots, shape (Q, N, 9)."""
    return np.concatenate([signals.phi, signals.theta, signals.tau], axis=2)


def _high(signals: Signals) -> float:
    """From where on there is noise alone [Hz]."""
    return float(min(NOISE_ABOVE_HZ, 0.4 * min(signals.rate_hz, *native_hz(signals))))


def _levels(signals: Signals) -> tuple[Array, Array]:
    """White noise of a reading with the lines, and without, shape (N, 9) each.

    A conversion leaves less of it there; how much, it shows on noise of one.
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
    """Root mean squares above a frequency: with the lines there, robust against moments; and between the lines."""
    band = butter(4, high, btype="high", fs=rate_hz, output="sos")
    fast = np.asarray(sosfiltfilt(band, x, axis=0), dtype=np.float64)
    over_time = 1.4826 * np.median(np.abs(fast), axis=0)
    frequency, density = periodogram(fast, rate_hz, window="hann", axis=0)
    # Powers of white noise are exponentially distributed: ln 2 of their mean is the median.
    level = np.median(density[frequency > high], axis=0) / np.log(2.0)
    return over_time, np.sqrt(level * (rate_hz / 2.0 - high))


def chattering(trials: Sequence[Signals]) -> tuple[str, ...]:
    """A sentence where a torque oscillates faster than a team moves, by so much that it is let through; for the notes.

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
