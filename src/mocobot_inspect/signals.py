"""What the wiring of a log is judged by: filtered channels with their rates, at a few hundred instants.

Wiring mistakes permute, turn round, scale and shift channels. All of that commutes with filters and differences, so a
mistake is undone on these few numbers and not on the log.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from estimator.filtering import differentiate, low_pass
from mocobot_logs.log import Level

Array = NDArray[np.float64]
Kind = Literal["position", "theta", "effort"]
KINDS: tuple[Kind, ...] = ("position", "theta", "effort")

RATE_HZ = 100.0
CUTOFF_HZ = 5.0
TRIM_S = 1.0
"""Transients of the filter die as exp(-pi 5 Hz t): 1e-7 of them is left."""
INSTANTS = 200


@dataclass(frozen=True, eq=False)
class Group:
    """Three channels of every robot.

    Attributes:
        values: filtered samples, rates and accelerations [SI], shape (3, Q, N, 3).
        noise: white noise of one unfiltered sample [SI], shape (N, 3).
    """

    values: Array
    noise: Array

    def arranged(self, robots: Sequence[int], order: Sequence[int], signs: Sequence[int]) -> Group:
        """Channel k of some robots is channel ``order[k]`` times ``signs[k]``."""
        values, noise = self.values.copy(), self.noise.copy()
        for robot in robots:
            values[:, :, robot] = self.values[:, :, robot][..., list(order)] * np.asarray(signs, dtype=float)
            noise[robot] = self.noise[robot][list(order)]
        return Group(values, noise)

    def scaled(self, robots: Sequence[int], factor: float) -> Group:
        """The channels of some robots in another unit."""
        values, noise = self.values.copy(), self.noise.copy()
        values[:, :, list(robots)] *= factor
        noise[list(robots)] *= factor
        return Group(values, noise)

    def shifted(self, robots: Sequence[int], offset: Sequence[float]) -> Group:
        """The channels of some robots with another zero [SI], three numbers."""
        values = self.values.copy()
        values[0][:, list(robots)] += np.asarray(offset, dtype=float)
        return Group(values, self.noise)

    def renumbered(self, order: Sequence[int]) -> Group:
        """Robot i gets what robot ``order[i]`` has."""
        return Group(self.values[:, :, list(order)], self.noise[list(order)])


@dataclass(frozen=True, eq=False)
class Signals:
    """A team's channels.

    Attributes:
        level: joint (phi, theta, tau) or wrist (h, theta, force).
        position: phi [rad] or h [m].
        theta: gimbal angles (theta_z, theta_y, theta_x) [rad].
        effort: tau [N m] or force [N].
    """

    level: Level
    position: Group
    theta: Group
    effort: Group

    @property
    def robots(self) -> int:
        """Number of robots N."""
        return self.theta.values.shape[2]

    @property
    def instants(self) -> int:
        """Number of instants Q."""
        return self.theta.values.shape[1]

    def group(self, kind: Kind) -> Group:
        """One of the three groups."""
        return getattr(self, kind)

    def having(self, kind: Kind, group: Group) -> Signals:
        """The same with another group in one place."""
        return replace(self, **{kind: group})


def signals_of(level: Level, stretches: Sequence[Array], noise: Array, instants: int = INSTANTS) -> Signals:
    """Filter uniform stretches of a log and pick instants evenly.

    Args:
        level: what the channels are.
        stretches: samples at ``RATE_HZ``, each (q, N, 9) in the order of ``CHANNELS[level]``; each longer than
            twice ``TRIM_S``.
        noise: white noise of every channel [SI], shape (N, 9).
        instants: about how many instants to keep.
    """
    drop = round(TRIM_S * RATE_HZ)
    parts = []
    for stretch in stretches:
        value = low_pass(stretch, RATE_HZ, CUTOFF_HZ)
        rate = differentiate(value, RATE_HZ)
        parts.append(np.stack([value, rate, differentiate(rate, RATE_HZ)])[:, drop:-drop])
    values = np.concatenate(parts, axis=1)
    keep = np.unique(np.linspace(0, values.shape[1] - 1, instants).astype(int))
    values = values[:, keep]
    groups = [Group(values[..., 3 * k : 3 * k + 3], noise[:, 3 * k : 3 * k + 3]) for k in range(3)]
    return Signals(level, *groups)


@cache
def noise_gains() -> tuple[float, float, float]:
    """Noise of filtered samples, their rates and accelerations over that of one raw sample [1, 1/s, 1/s^2]."""
    impulse = np.zeros(1001)
    impulse[500] = 1.0
    value = low_pass(impulse, RATE_HZ, CUTOFF_HZ)
    rate = differentiate(value, RATE_HZ)
    acceleration = differentiate(rate, RATE_HZ)
    norms = [float(np.linalg.norm(response)) for response in (value, rate, acceleration)]
    return norms[0], norms[1], norms[2]
