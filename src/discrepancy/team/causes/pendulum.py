"""A pendulum that hangs from a point which is moved: how it swings, up to 0.3 rad rms."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import cast

import numpy as np
from scipy.signal import cont2discrete, lfilter

from estimator.arrays import Array

SWING_ROUNDS, SWING_FIRST_ROUNDS, SWING_SETTLED = 20, 1, 1e-4
"""Times a pendulum that swings far is swung again, the same while shapes are only looked through, and the change from
which it is enough. Chosen: sizes are told to a percent."""

SWING_MOST, SWING_START, SWING_EASED = 0.95, 0.9, 0.6
"""How far it swings at most, over its length, the same while it is sought, and by which share its restoring force is
less at most. Chosen: a mass beside its pivot is no pendulum."""

SWING_CALM, SWING_WEIGHT, SWING_LEAST_WEIGHT = 0.5, 0.7, 0.3
"""Change of a round over that of the last, from which rounds go to and fro; by which a new one counts less then, and
how much at least. Chosen."""


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

    def restored(self, steeper: float) -> Pendulum:
        """One whose restoring force is steeper [1/s^2], damped by as much."""
        stiff = self.gravity / self.length_m + steeper
        ratio = 0.5 * self.damping_per_s / np.sqrt(stiff)
        return Pendulum(self.gravity / stiff, float(ratio), self.gravity, self.rate_hz)

    def small(self, drive: Array, integrals: int) -> Array:
        """Small swings, from rest: relative acceleration (0 integrals), speed (1) or displacement (2).

        Args:
            drive: acceleration of the point, linear between samples, shape (Q, ...).
            integrals: of the acceleration.
        """
        numerators, denominator = _filters(self)
        return np.asarray(lfilter(numerators[integrals], denominator, drive, axis=0), dtype=np.float64)


def swung(
    drives: Sequence[Array],
    turned: Sequence[Array],
    lift: Array,
    pendulums: Sequence[Pendulum],
    rounds: int = SWING_ROUNDS,
) -> tuple[list[Array], list[Array], Array]:
    """How 1 kg swings on two level ways whose damper turns with what it hangs in, from rest.

    Off by x and y the mass is higher by z, so that (Lagrange's equations)

        x'' + z_x (z'' + b + g) + damper = -a,

    and y alike; a and b are the point's acceleration along the way and upwards, and z_x is the slope of z, which is
    x / length where it is small. Solved by rounds: what the last swing leaves of the straight line nearest to its
    restoring force (Krylov and Bogoliubov's equivalent linearisation) is put beside the drive. Rounds settle up to some
    0.3 rad rms (0.8 rad at most); beyond, what is returned is finite and not told how wrong.

    Args:
        drives: acceleration of the point along each level way, then by how much more per unit of something, (Q, k).
        turned: rate at which what the damper is fixed to turns about each way's axis [rad/s], shape (Q,) each.
        lift: upward acceleration of the point [m/s^2], shape (Q,).
        pendulums: on each way; the hinge of the first is on the rod of the second.
        rounds: at most.

    Returns:
        Relative accelerations [m/s^2] and moments of the damper [N m] of each way, shape (Q, k) each, and upward
        acceleration [m/s^2], shape (Q,). What is per unit of something is that of small swings.
    """
    held = [
        drive[:, 0] - own.damping_per_s * own.length_m * rate
        for own, drive, rate in zip(pendulums, drives, turned, strict=True)
    ]
    swing, last, weight = _swing(pendulums, held), np.inf, 1.0
    # Small swings grow without end; to begin with, and ever after, none goes farther than its rod.
    swing *= _within(pendulums, swing)
    far = Far.of(pendulums, swing, turned, lift)
    for _ in range(rounds):
        lines = [
            _line(own, way[0], more) for own, way, more in zip(pendulums, swing, far.beyond, strict=True)
        ]
        eased = [own.restored(k) for own, k in zip(pendulums, lines, strict=True)]
        driven = [
            drive + more - k * way[0]
            for drive, more, k, way in zip(held, far.beyond, lines, swing, strict=True)
        ]
        new = weight * _swing(eased, driven) + (1.0 - weight) * swing
        moved = float(np.sqrt(np.mean((new - swing) ** 2) / max(float(np.mean(new**2)), 1e-300)))
        if moved > SWING_CALM * min(last, 1.0):  # it goes to and fro
            weight = max(SWING_WEIGHT * weight, SWING_LEAST_WEIGHT)
        new *= _within(pendulums, new)
        swing, last, far = new, moved, Far.of(pendulums, new, turned, lift)
        if moved < SWING_SETTLED:
            break
    swings, damped = [], []
    for own, drive, way, rate in zip(pendulums, drives, swing, far.rates, strict=True):
        swings.append(np.column_stack([way[2], own.small(drive[:, 1:], 0)]))
        speeds = np.column_stack([own.length_m * rate, own.small(drive[:, 1:], 1)])
        damped.append(own.damping_per_s * own.length_m * speeds)
    return swings, damped, far.rising


def _swing(pendulums: Sequence[Pendulum], driven: Sequence[Array]) -> Array:
    """Displacement, speed and acceleration of small swings along each way, shape (2, 3, Q)."""
    return np.array(
        [
            [own.small(x, integrals) for integrals in (2, 1, 0)]
            for own, x in zip(pendulums, driven, strict=True)
        ]
    )


def _within(pendulums: Sequence[Pendulum], swing: Array) -> Array:
    """By which share swings are to be lessened to stay within their rods, of each way, shape (2, 1, 1)."""
    most = np.abs(swing[:, 0]).max(axis=1) / [SWING_START * own.length_m for own in pendulums]
    return np.asarray(1.0 / np.maximum(most, 1.0))[:, None, None]


def _line(own: Pendulum, x: Array, beyond: Array) -> float:
    """By how much the straight line nearest to the restoring force is steeper than that of small swings [1/s^2]."""
    steeper = float(beyond @ x / max(float(x @ x), 1e-300))
    return max(steeper, -SWING_EASED * own.gravity / own.length_m)


@dataclass(frozen=True, eq=False)
class Far:
    """What a pendulum that swings far does beyond its small swings.

    Attributes:
        beyond: what drives it besides, along each way [m/s^2], shape (Q,) each.
        rising: its upward acceleration [m/s^2], shape (Q,).
        rates: of its hinges [rad/s], shape (Q,) each.
    """

    beyond: list[Array]
    rising: Array
    rates: list[Array]

    @classmethod
    def of(cls, pendulums: Sequence[Pendulum], swing: Array, turned: Sequence[Array], lift: Array) -> Far:
        """Along the first way it swings on L, from a hinge on the rod on which it swings along the other, of length A.

        So it hangs ((A - L + (L^2 - x^2)^0.5)^2 - y^2)^0.5 below that one's hinge; z is what that lacks of A.

        Args:
            pendulums: along both ways.
            swing: displacements, speeds and accelerations along them, shape (2, 3, Q).
            turned, lift: as of ``swung``.
        """
        (one, two), ((x, dx, ddx), (y, dy, ddy)) = pendulums, swing
        L, A, most = one.length_m, two.length_m, SWING_MOST
        x, y = np.clip(x, -most * L, most * L), np.clip(y, -most * min(A, L), most * min(A, L))
        along = np.sqrt(L**2 - x**2)
        rod = np.maximum(A - L + along, (1.0 - most) * A)
        below = np.sqrt(np.maximum(rod**2 - y**2, ((1.0 - most) * A) ** 2))
        slopes = rod / below * x / along, y / below
        steeper = [np.gradient(slope) * one.rate_hz for slope in slopes]
        rising = steeper[0] * dx + steeper[1] * dy + slopes[0] * ddx + slopes[1] * ddy
        # Hinge angles are asin(x / L) and asin(y / rod).
        rates = [dx / along - turned[0], (dy + x * y * dx / (along * rod)) / below - turned[1]]
        first, second = one.damping_per_s * L**2 * rates[0], two.damping_per_s * A**2 * rates[1]
        damper = [first / along + second * x * y / (along * rod * below), second / below]
        beyond = [
            slope * (rising + lift + own.gravity)
            - own.gravity / own.length_m * way
            + felt
            - own.damping_per_s * (speed - own.length_m * rate)
            for own, slope, way, felt, speed, rate in zip(
                pendulums, slopes, (x, y), damper, (dx, dy), turned, strict=True
            )
        ]
        return cls(beyond, np.asarray(rising), rates)


@lru_cache(maxsize=256)
def _filters(pendulum: Pendulum) -> tuple[list[Array], Array]:
    """Numerators for acceleration, speed and displacement, and their denominator."""
    w = np.sqrt(pendulum.gravity / pendulum.length_m)
    rates = np.array([[0.0, 1.0], [-(w**2), -2.0 * pendulum.damping_ratio * w]])  # of displacement and speed
    out = np.array([rates[1], [0.0, 1.0], [1.0, 0.0]])
    system = rates, np.array([[0.0], [-1.0]]), out, np.array([[-1.0], [0.0], [0.0]])
    discrete = cont2discrete(system, 1.0 / pendulum.rate_hz, method="foh")
    A, B, C, D, _ = cast("tuple[Array, Array, Array, Array, float]", discrete)
    trace, det = np.trace(A), A[0, 0] * A[1, 1] - A[0, 1] * A[1, 0]
    # C (z - A)^-1 B + D: (z - A)^-1 is (z + A - trace) over the denominator.
    ends = C @ (A - trace * np.eye(2)) @ B + D * det
    numerators = np.concatenate([D, C @ B - D * trace, ends], axis=1)
    return list(numerators), np.array([1.0, -trace, det])
