"""What of the torque is noise: as loud as sensors are where nothing moves, as coloured as what all causes leave.

Weights must suit what will be left over. So the colour, and how the
joints' rows go together, is that of what the whole catalogue leaves, and the level that of the sensors: the torque's
own, read off above the rows' frequencies, and that of the positions, through the nominal model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, minimum_filter1d
from scipy.signal import welch

from discrepancy.least_squares.whitening import Whitening
from discrepancy.rules import serial as rules
from discrepancy.serial.mechanics.regressor import rigid_torque, torque_of
from discrepancy.serial.recording.joint_log import JointLog
from discrepancy.serial.rows.reduction import Reduction
from discrepancy.serial.rows.signals import Signals, smoothing_hz, work_step
from estimator.arrays import Array
from estimator.filtering import differentiate, low_pass


@dataclass(frozen=True, eq=False)
class SensorNoise:
    """A draw of what the sensors of one log add, at the rate of the mechanics, shape (W, J) each.

    Attributes:
        torque: of the torques.
        q, dq, ddq: of the positions, through the filter, and its derivatives.
    """

    torque: Array
    q: Array
    dq: Array
    ddq: Array

    @classmethod
    def of(cls, signals: Signals, rng: np.random.Generator) -> SensorNoise:
        """As loud as the log is where nothing moves; rounding counts as white."""
        log, rate = signals.log, signals.log.rate_hz
        torque = np.nan_to_num(log.torque) if log.torque is not None else np.zeros_like(log.q)
        # A log that was resampled has been low-passed from a fifth of its rate on.
        top = rules.FILTERED_BAND if log.resampled else rules.TOP_BAND
        low, high = (share * signals.cutoff_hz for share in rules.NOISE_BAND)
        torque_density = _density(torque, rate, min(low, top[0] * rate), min(high, top[1] * rate))
        rounding = log.position_step**2 / 12.0 / (rate / 2.0)
        angle_density = np.maximum(_density(log.q, rate, top[0] * rate, top[1] * rate), rounding)
        white = np.sqrt(rate / 2.0) * rng.standard_normal((2, *log.q.shape))
        white[1] *= _changing(log)
        smooth = [
            low_pass(np.sqrt(density) * x, rate, smoothing_hz(rate))
            for density, x in zip((torque_density, angle_density), white, strict=True)
        ]
        dq = differentiate(smooth[1], rate)
        return cls(*(x[:: work_step(rate)] for x in (*smooth, dq, differentiate(dq, rate))))

    def added(self, signals: Signals) -> Signals:
        """The signals with as much noise of the positions once more."""
        moved = (signals.q + self.q, signals.dq + self.dq, signals.ddq + self.ddq)
        inverse = torque_of(signals.tree, *moved) + signals.tree.armature * moved[2]
        before = rigid_torque(signals.motion) + signals.tree.armature * signals.ddq
        # What else the model's torques hold, such as springs, does not feel the noise.
        q, dq, ddq = moved
        return replace(signals, q=q, dq=dq, ddq=ddq, inverse=signals.inverse + inverse - before)

    def of_angles(self, signals: Signals, reduction: Reduction) -> list[Array]:
        """What the positions' noise makes of the rows of every block, through the nominal model, shape (n, J)."""
        return reduction(signals.inverse - self.added(signals).inverse)


def _changing(log: JointLog) -> NDArray[np.bool_]:
    """Where the readings of positions change, shape (Q, J): one that stands still, by its step, has no noise at all."""
    size = max(3, 2 * round(rules.STILL_S * log.rate_hz / 2.0) + 1)
    spread = maximum_filter1d(log.q, size, axis=0) - minimum_filter1d(log.q, size, axis=0)
    return spread > rules.STILL_STEPS * log.position_step


def draws_of(rows: Sequence[Array], moving: Sequence[Array]) -> Array:
    """Rows (n, C) of blocks cut to one length, no quieter than a thousandth of the torques, shape (D, n, C).

    Args:
        rows: of the noise.
        moving: measured torques, the same.
    """
    shortest = min(len(block) for block in rows)
    draws = np.stack([block[:shortest] for block in rows])
    floor = rules.LEAST_LEVEL * np.sqrt(np.mean(np.concatenate(list(moving)) ** 2, axis=0))
    missing = np.sqrt(np.maximum(floor**2 - np.mean(draws**2, axis=(0, 1)), 0.0))
    return draws + missing * np.random.default_rng(rules.NOISE_SEED).standard_normal(draws.shape)


def whitening_of(
    left: Sequence[Array], freedom: float, uncertain: Sequence[Array], sensors: Array, moving: Sequence[Array]
) -> tuple[tuple[Whitening, ...], Array]:
    """Whitening of every block's rows, and the sensors' noise over what the whole catalogue leaves, shape (C,).

    Args:
        left: what the whole catalogue leaves, rows (n, C) per block.
        freedom: share of the rows' freedom that its fit has left.
        uncertain: standard deviations of what dry friction adds where joints turn round, the same.
        sensors: a draw of the sensors' noise, shape (D, n, C).
        moving: measured torques, rows (n, C) per block.
    """
    # Half of the rows are quieter than the median, whatever the reversals do to the others.
    quiet = np.median(np.abs(np.concatenate(list(left))), axis=0) / 0.6745
    quiet = np.maximum(quiet, rules.LEAST_LEVEL * np.sqrt(np.mean(np.concatenate(list(moving)) ** 2, axis=0)))
    loud = [np.sqrt(1.0 + (x / quiet) ** 2) for x in uncertain]
    even = draws_of([x / y / np.sqrt(freedom) for x, y in zip(left, loud, strict=True)], moving)
    white = Whitening.of(even, even.shape[1], rules.AR_ORDER)
    level = [
        np.sqrt(np.mean(np.array([white(x)[rules.AR_ORDER :] for x in draws]) ** 2, axis=(0, 1)))
        for draws in (sensors, even)
    ]
    # Whitened channels are joints less what those before them tell of their noise, so each has one joint's level.
    level = np.minimum(level[0] / level[1], 1.0)
    shared = Whitening.of(even * level, even.shape[1], rules.AR_ORDER)
    # The reversals' own part stays as large as it is, however quiet the sensors are.
    again = [np.sqrt(1.0 + (x / (quiet * level)) ** 2) for x in uncertain]
    return tuple(replace(shared, moving=len(y), loudness=y) for y in again), level


def _density(x: Array, rate_hz: float, low: float, high: float) -> Array:
    """Power density of every channel in a band, median over time and frequency, shape (J,) per hertz."""
    size = min(len(x), max(16, round(rules.SEGMENT_S * rate_hz)))
    starts = range(0, len(x) - size + 1, max(1, size // 2))
    frequency, each = np.zeros(0), []
    for start in starts:
        frequency, power = welch(x[start : start + size], rate_hz, nperseg=size, axis=0, detrend="linear")
        each.append(power)
    band = (frequency >= low) & (frequency <= high)
    if not band.any():
        band = frequency >= frequency[-1] / 2.0
    # A periodogram's ordinate scatters as chi-square of two degrees of freedom, whose median is ln 2 of its mean.
    return np.asarray(np.median(np.array(each)[:, band], axis=(0, 1)) / np.log(2.0))
