"""How finely each sensor reads: rounding step and white noise, found in the recording itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import butter, sosfiltfilt

from discrepancy import rules
from discrepancy.team.linear.signals import Signals
from estimator.arrays import Array
from estimator.filtering import low_pass
from estimator.quantisation import quantisation_step


@dataclass(frozen=True, eq=False)
class Noise:
    """Resolution of every channel; arrays of shape (3, N, 3): phi, theta, tau.

    Attributes:
        step: rounding step, 0 for a continuous channel [rad, rad, N m].
        sigma: standard deviation of white noise before rounding [rad, rad, N m].
    """

    step: Array
    sigma: Array

    @classmethod
    def of(cls, trials: list[Signals]) -> Noise:
        """Resolution of the sensors behind some trials."""
        step, sigma = [], []
        angle, torque = rules.ANGLE_FLOOR_RAD, rules.TORQUE_FLOOR_NM
        for field, floor in (("phi", angle), ("theta", angle), ("tau", torque)):
            x = [getattr(trial, field) for trial in trials]
            # Trial by trial: the grid may lie differently in each.
            steps = np.median([np.apply_along_axis(_step, 0, a) for a in x], axis=0)
            white = np.sqrt(
                np.mean([_white(a, t.rate_hz) ** 2 for a, t in zip(x, trials, strict=True)], axis=0)
            )
            sigma.append(np.sqrt(np.maximum(np.maximum(white, floor) ** 2 - steps**2 / 12.0, 0.0)))
            step.append(steps)
        return cls(np.array(step), np.array(sigma))

    def draw(self, signals: Signals, rng: np.random.Generator) -> Signals:
        """One realisation of the sensors' errors on a trial: what they would add to its smooth signals."""
        errors: list[Array] = []
        for k, field in enumerate(("phi", "theta", "tau")):
            x = low_pass(getattr(signals, field), signals.rate_hz, rules.TEAM_SMOOTH_HZ)
            step = np.where(self.step[k] > 0, self.step[k], 1.0)
            x = x + step * _phase(x / step, rng)
            read = x + self.sigma[k] * rng.standard_normal(x.shape)
            errors.append(np.where(self.step[k] > 0, np.round(read / step) * step, read) - x)
        return Signals(signals.time, errors[0], errors[1], errors[2], signals.rate_hz)


def _phase(x: Array, rng: np.random.Generator) -> Array:
    """Where in its step a signal (in steps) truly is: constant while it rests, new after each step of travel.

    A resting encoder repeats one rounding error; what was recorded of it always lies on the grid itself.
    """
    travel = np.cumsum(np.abs(np.diff(x, axis=0, prepend=x[:1])), axis=0)
    segment = np.floor(travel).astype(np.intp)
    phase = rng.uniform(-0.5, 0.5, (int(segment.max()) + 1, *x.shape[1:]))
    return np.take_along_axis(phase, segment, axis=0)


def _step(x: Array) -> float:
    """Rounding step of a channel, or 0 without one; where values hardly repeat, rounding is as good as noise."""
    return 0.0 if len(np.unique(x)) > 0.9 * len(x) else quantisation_step(x, levels=2) or 0.0


def _white(x: Array, rate_hz: float) -> Array:
    """Standard deviation of white noise, from what lies above 25 Hz (a robust mean square), shape (N, 3)."""
    high = min(rules.NOISE_ABOVE_HZ, 0.4 * rate_hz)
    y = sosfiltfilt(butter(4, high, btype="high", fs=rate_hz, output="sos"), x, axis=0)
    share = 1.0 - high / (rate_hz / 2.0)
    return 1.4826 * np.median(np.abs(y), axis=0) / np.sqrt(share)
