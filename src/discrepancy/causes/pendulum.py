"""A pendulum that hangs from a point which is moved: how it swings, to third order of its angle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import cast

import numpy as np
from scipy.signal import cont2discrete, lfilter

from estimator.arrays import Array


@dataclass(frozen=True)
class Pendulum:
    """On one level way.

    Attributes:
        length_m: of its rod [m].
        damping_ratio: of small swings.
        gravity: of the place [m/s^2].
        rate_hz: of samples.
    """

    length_m: float
    damping_ratio: float
    gravity: float
    rate_hz: float

    @property
    def damping_per_s(self) -> float:
        """Of its speed, what slows it down."""
        return float(2.0 * self.damping_ratio * np.sqrt(self.gravity / self.length_m))

    def small(self, drive: Array, integrals: int) -> Array:
        """Small swings, from rest: relative acceleration (0 integrals), speed (1) or displacement (2).

        Args:
            drive: acceleration of the point, linear between samples, shape (Q, ...).
            integrals: of the acceleration.
        """
        return np.asarray(lfilter(*_filter(self, integrals), drive, axis=0), dtype=np.float64)


def swung(
    drives: Sequence[Array], turned: Sequence[Array], lift: Array, pendulums: Sequence[Pendulum]
) -> tuple[list[Array], list[Array], Array]:
    """How 1 kg swings whose damper turns with what it hangs in, from rest.

    On a sphere of radius L the mass is higher by z = (x^2 + y^2) / (2 L) + ... when it is off by x and y, so that
    x'' + 2 zeta w (x' - v) + w^2 x = -a - (x / L) (b + z'' + g (x^2 + y^2) / (2 L^2)), with v as fast as it would swing
    if it turned with the damper, a and b the point's acceleration along the way and upwards. What is beyond first order
    is taken from small swings. It makes a pendulum slower by a sixteenth of the square of its angle.

    Args:
        drives: acceleration of the point along each level way, then by how much more per unit of something, (Q, k).
        turned: rate at which what the damper is fixed to turns about each way's axis [rad/s], shape (Q,) each.
        lift: upward acceleration of the point [m/s^2], shape (Q,).
        pendulums: on each way.

    Returns:
        Relative accelerations [m/s^2] and moments of the damper [N m] of each way, shape (Q, k) each, and upward
        acceleration [m/s^2], shape (Q,).
    """
    behind = [own.length_m * rate for own, rate in zip(pendulums, turned, strict=True)]
    driven = [drive.copy() for drive in drives]
    small = []
    for own, drive, speed in zip(pendulums, driven, behind, strict=True):
        drive[:, 0] -= own.damping_per_s * speed
        small.append([own.small(drive[:, 0], integrals) for integrals in (2, 1, 0)])
    each = list(zip(pendulums, small, strict=True))
    rising = sum((v * v + x * a) / own.length_m for own, (x, v, a) in each)
    steep = sum(0.5 * (x / own.length_m) ** 2 for own, (x, _, _) in each)
    swings, damped = [], []
    for own, drive, (x, _, _), speed in zip(pendulums, driven, small, behind, strict=True):
        drive[:, 0] += x / own.length_m * (lift + rising + own.gravity * steep)
        relative = own.small(drive, 1)
        relative[:, 0] -= speed
        swings.append(own.small(drive, 0))
        damped.append(own.damping_per_s * own.length_m * relative)
    return swings, damped, np.asarray(rising)


@lru_cache(maxsize=256)
def _filter(pendulum: Pendulum, integrals: int) -> tuple[Array, Array]:
    """Numerator and denominator, the same in every trial."""
    w = np.sqrt(pendulum.gravity / pendulum.length_m)
    continuous = [-1.0, *[0.0] * (2 - integrals)], [1.0, 2.0 * pendulum.damping_ratio * w, w**2]
    found = cast(
        "tuple[Array, Array, float]", cont2discrete(continuous, 1.0 / pendulum.rate_hz, method="foh")
    )
    return np.ravel(found[0]), found[1]
