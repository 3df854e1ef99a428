"""Prescribed motion of the payload: band-limited random, periodic, and poses that are held."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from independent.numerics import FINE_HZ, Array, smooth_step

PAD_S = 0.5
"""Rest before and after what is recorded, for delays and derivatives [s]."""
REST_S = 2.0
_RAMP_S = 3.0
_HOLD_S, _MOVE_S = 3.0, 1.3


@dataclass(frozen=True)
class Motion:
    """Displacement of the payload from home over time.

    Attributes:
        kind: of trial, as a recording calls it.
        time: on the fine grid, 0 where the recording starts [s], shape (Q,).
        shift: of the point about which it turns, W axes [m], shape (Q, 3).
        turn: rotation vector from home, W axes [rad], shape (Q, 3).
    """

    kind: str
    time: Array
    shift: Array
    turn: Array

    def scaled(self, factor: float) -> Motion:
        """The same motion, smaller."""
        return Motion(self.kind, self.time, self.shift * factor, self.turn * factor)

    @property
    def duration_s(self) -> float:
        """Length of what is recorded [s]."""
        return float(self.time[-1]) - PAD_S


def random_motion(rng: np.random.Generator, duration_s: float = 35.0) -> Motion:
    """Sums of sines of 0.1 to 0.6 Hz at no common period, at rest for 2 s at either end."""
    time = _grid(duration_s)
    waves = np.zeros((len(time), 6))
    for axis in range(6):
        rate = rng.uniform(0.1, 0.6, 9)
        size = rng.uniform(0.4, 1.0, 9) / np.sqrt(rate)
        waves[:, axis] = np.sin(2 * np.pi * np.outer(time, rate) + rng.uniform(0, 2 * np.pi, 9)) @ size
    return _windowed("random", rng, time, waves)


def periodic_motion(rng: np.random.Generator, duration_s: float = 30.0) -> Motion:
    """Five harmonics of 0.1 Hz on every axis, at rest for 2 s at either end."""
    time = _grid(duration_s)
    rate = 0.1 * np.arange(1, 6)
    waves = np.zeros((len(time), 6))
    for axis in range(6):
        size = rng.uniform(0.2, 1.0, 5) / np.sqrt(rate)
        waves[:, axis] = np.sin(2 * np.pi * np.outer(time, rate) + rng.uniform(0, 2 * np.pi, 5)) @ size
    return _windowed("periodic", rng, time, waves)


def static_motion(rng: np.random.Generator, poses: int = 10) -> Motion:
    """Poses that are held for 3 s each, with smooth moves between them; home comes first."""
    time = _grid(poses * _HOLD_S + (poses - 1) * _MOVE_S)
    spread = np.array([0.045] * 3 + [0.12] * 3)
    goals = rng.uniform(-1, 1, (poses, 6)) * spread
    goals[0] = 0.0
    path: Array = np.zeros((len(time), 6))
    for k in range(1, poses):
        start = k * _HOLD_S + (k - 1) * _MOVE_S
        path = path + smooth_step((time - start) / _MOVE_S)[:, None] * (goals[k] - goals[k - 1])
    return Motion("static", time, path[:, :3], path[:, 3:])


MOTIONS: Mapping[str, Callable[[np.random.Generator], Motion]] = {
    "random": random_motion, "periodic": periodic_motion, "static": static_motion,
}  # fmt: skip
"""By kind of trial."""


def _grid(duration_s: float) -> Array:
    pad = round(PAD_S * FINE_HZ)
    return np.arange(-pad, round(duration_s * FINE_HZ) + pad + 1) / FINE_HZ


def _windowed(kind: str, rng: np.random.Generator, time: Array, waves: Array) -> Motion:
    end = time[-1] - PAD_S
    window = smooth_step((time - REST_S) / _RAMP_S) * smooth_step((end - REST_S - time) / _RAMP_S)
    path = waves * window[:, None]
    largest = np.concatenate([rng.uniform(0.040, 0.050, 3), rng.uniform(0.105, 0.140, 3)])
    path = np.asarray(path * (largest / np.abs(path).max(axis=0)), dtype=float)
    return Motion(kind, time, path[:, :3], path[:, 3:])
