"""Signals for the wiring check of a team's log: filtered channels with their derivatives, at a few hundred instants.

Wiring mistakes permute, negate, scale and shift channels. These operations commute with filters and differences. A
mistake can therefore be undone on these few numbers instead of the log.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Literal

import numpy as np

from estimator.arrays import Array
from estimator.filtering import differentiate, low_pass
from mocobot_logs.log import Level

Kind = Literal["position", "theta", "effort"]
KINDS: tuple[Kind, ...] = ("position", "theta", "effort")

RATE_HZ = 100.0
CUTOFF_HZ = 5.0
TRIM_S = 1.0  # time dropped at either end [s]; the filter's transients decay as exp(-pi 5 Hz t), to 1e-7 here
INSTANTS = 200


@dataclass(frozen=True, eq=False)
class Group:
    """Three channels of every robot."""

    values: Array  # filtered samples, rates and accelerations [SI], shape (3, Q, N, 3)
    noise: Array  # white noise of one unfiltered sample [SI], shape (N, 3)

    def mapped(
        self,
        robots: Sequence[int],
        order: Sequence[int] = (0, 1, 2),
        factors: Sequence[float] | float = 1.0,
        offset: Sequence[float] | float = 0.0,
    ) -> Group:
        """Return the group with channel k of some robots replaced by ``factors[k]`` times channel ``order[k]`` plus
        ``offset[k]``."""
        values, noise = self.values.copy(), self.noise.copy()
        columns, gains = list(order), np.asarray(factors, dtype=float)
        for robot in robots:
            values[:, :, robot] = self.values[:, :, robot][..., columns] * gains
            values[0, :, robot] += offset
            noise[robot] = self.noise[robot][columns] * np.abs(gains)
        return Group(values, noise)

    def taken(self, robots: Sequence[int], other: Group, of: Sequence[int]) -> Group:
        """Return the group in which ``robots`` have the channels of robots ``of`` in another group."""
        values, noise = self.values.copy(), self.noise.copy()
        at, source = list(robots), list(of)
        values[:, :, at], noise[at] = other.values[:, :, source], other.noise[source]
        return Group(values, noise)


@dataclass(frozen=True, eq=False)
class Signals:
    """Channels of a team."""

    level: Level  # joint (phi, theta, tau) or wrist (h, theta, force)
    position: Group  # phi [rad] or h [m]
    theta: Group  # gimbal angles (theta_z, theta_y, theta_x) [rad]
    effort: Group  # tau [N m] or force [N]

    @property
    def robots(self) -> int:
        return self.theta.values.shape[2]

    def group(self, kind: Kind) -> Group:
        return getattr(self, kind)

    def having(self, **groups: Group) -> Signals:
        """Return the signals with some groups replaced, by kind."""
        return replace(self, **groups)


def signals_of(level: Level, stretches: Sequence[Array], noise: Array) -> Signals:
    """Filter uniform stretches of a log and pick ``INSTANTS`` evenly spaced instants.

    Each stretch (q, N, 9) is at ``RATE_HZ``, in the order of ``CHANNELS[level]``, and longer than twice ``TRIM_S``;
    ``noise`` (N, 9) is the white noise of every channel [SI].
    """
    drop = round(TRIM_S * RATE_HZ)
    parts = []
    for stretch in stretches:
        value = low_pass(stretch, RATE_HZ, CUTOFF_HZ)
        rate = differentiate(value, RATE_HZ)
        parts.append(np.stack([value, rate, differentiate(rate, RATE_HZ)])[:, drop:-drop])
    values = np.concatenate(parts, axis=1)
    keep = np.unique(np.linspace(0, values.shape[1] - 1, INSTANTS).astype(int))
    return of_arrays(level, values[:, keep], noise)


def of_arrays(level: Level, values: Array, noise: Array) -> Signals:
    """Return signals from nine channels: values (3, Q, N, 9) and their noise (N, 9)."""
    groups = [Group(values[..., 3 * k : 3 * k + 3], noise[:, 3 * k : 3 * k + 3]) for k in range(3)]
    return Signals(level, *groups)


@cache
def noise_gains() -> tuple[float, float, float]:
    """Return noise of filtered samples, rates and accelerations over that of a raw sample [1, 1/s, 1/s^2]."""
    impulse = np.zeros(1001)
    impulse[500] = 1.0
    value = low_pass(impulse, RATE_HZ, CUTOFF_HZ)
    rate = differentiate(value, RATE_HZ)
    norms = [float(np.linalg.norm(response)) for response in (value, rate, differentiate(rate, RATE_HZ))]
    return norms[0], norms[1], norms[2]
