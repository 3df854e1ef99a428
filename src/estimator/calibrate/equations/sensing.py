"""How finely each joint reads: rounding step and white noise, from the recordings themselves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.signal import butter, sosfiltfilt

from estimator.arrays import Array
from estimator.calibrate import rules
from estimator.calibrate.equations.rows import Rows
from estimator.quantisation import rounding_step
from estimator.recording.model import Recording


class Resolution(NamedTuple):
    """What one recording says of its sensors; arrays of shape (N, 9): phi, theta, tau.

    Attributes:
        step: rounding step, 0 for a continuous channel [rad, N m].
        white: standard deviation of all that is white in a sample, rounding included [rad, N m].
        share: as in ``Sensing``, shape (N, 1).
    """

    step: Array
    white: Array
    share: Array

    @classmethod
    def of(cls, recording: Recording) -> Resolution:
        """Of one recording."""
        step, white = _steps(recording), _white(recording)
        if recording.metadata.sampling is None:
            # The ripple of a slow joint's rounding is no noise: without noise, no reading goes to and fro.
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
        sigma: standard deviation of white noise of a sample before rounding [rad, N m].
        share: samples over readings, shape (N, 1) or 1: white errors of several readings that went into a sample, or
            of one that went into several, have this share of their variance, as far as frequencies in a row go.
    """

    step: Array
    sigma: Array
    share: Array | float = 1.0

    @classmethod
    def of(cls, recordings: Sequence[Recording]) -> Sensing:
        """Resolution of the sensors behind some recordings of the same robots, read and converted alike."""
        return cls.pooled([Resolution.of(recording) for recording in recordings])

    @classmethod
    def pooled(cls, found: Sequence[Resolution]) -> Sensing:
        """The same from what each says."""
        step = np.median([one.step for one in found], axis=0)
        white = np.sqrt(np.mean([one.white**2 for one in found], axis=0))
        share = np.mean([one.share for one in found], axis=0)
        return cls(step, np.sqrt(np.maximum(white**2 - share * step**2 / 12.0, 0.0)), share)

    @classmethod
    def of_each(cls, found: Sequence[Resolution]) -> list[Sensing]:
        """The same for each recording, from all that were read and converted alike."""
        rates = [tuple(np.round(one.share.ravel(), 3)) for one in found]
        pools = {
            rate: cls.pooled([one for one, its in zip(found, rates, strict=True) if its == rate])
            for rate in set(rates)
        }
        return [pools[rate] for rate in rates]

    def variances(self, rows: Rows) -> tuple[Array, Array]:
        """Variance of one sample in motion, and of a row's mean in a hold, shape (n, N, 9) each.

        In motion a joint that makes few steps while a row is averaged has few independent rounding errors; at rest it
        has one, unless noise moves the reading to and fro.
        """
        least = np.repeat([rules.PHI_FLOOR_RAD, rules.THETA_FLOOR_RAD, rules.TORQUE_FLOOR_NM], 3) ** 2
        floor = least * rows.rate_hz / rules.FLOOR_HZ
        rounding, noise = self.step**2 / 12.0, self.sigma**2
        step = np.maximum(self.step, 1e-300)
        dithered = self.sigma > rules.DITHER * step * np.sqrt(self.share)
        # Readings that count in a row in motion: those of a white signal.
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
    """Share of slow changes, of a step at most, that the next one takes back, shape (N, 9); 1 where few are slow."""
    change = np.rint(np.diff(_columns(recording), axis=0) / np.where(step > 0, step, np.inf))
    slow = np.all([np.abs(change[1:]) <= 1, np.abs(change[:-1]) <= 1], axis=0)
    back, count = np.sum(slow & (change[1:] * change[:-1] < 0), axis=0), np.sum(slow, axis=0)
    return np.where((count < rules.LEAST_SLOW) | (step == 0), 1.0, back / np.maximum(count, 1))


def _share(recording: Recording) -> Array:
    """Rate of the samples over that of each robot's readings, shape (N, 1)."""
    told, rate = recording.metadata.sampling, recording.metadata.rate_hz
    if told is None:
        return np.ones((recording.metadata.robots, 1))
    return np.array([[rate / one.native_hz] for one in told])


def _white(recording: Recording) -> Array:
    """Standard deviation of all that is white in a sample, rounding included, shape (N, 9).

    As it is told by what lies above all motion; of samples that were converted little is left there, and it is told by
    the highest frequencies that a conversion lets pass.
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
