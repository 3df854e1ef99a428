"""Pushes that are not rectangles."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from mocobot.campaign.effects import REACH_M
from mocobot_sim.trial.actors import Actor
from sealed.forms.base import Form, Place, direction, near, vector
from sealed.forms.parts import PointForce
from sealed.ground import Ground


@dataclass(frozen=True)
class _ShapedPush(Form):
    """A force during an interval of one trial; ``peak_*`` in robot 1's {b}, the point in {1}."""

    answer = "push"
    size = "peak_N"
    on_payload = True
    repeats = True
    ranges: ClassVar = {
        "start_s": (0.0, 1e9),
        "duration_s": (0.05, 1e9),
        "peak_N": (0.0, 1e3),
        "rise": (0.0, 0.5),
    }
    trial: int
    start_s: float
    duration_s: float
    rise: float
    peak_N: float
    along_x_m: float
    along_y_m: float
    along_z_m: float
    point_x_m: float
    point_y_m: float
    point_z_m: float

    @classmethod
    def drawn(
        cls, size: float, ground: Ground, place: Place, rng: np.random.Generator, trial: int | None = None
    ) -> Form:
        chosen = [at for at in ground.moving if trial in (None, at[0])]
        number, begin, end = chosen[rng.integers(len(chosen))]
        duration = float(rng.uniform(0.8, 3.0))
        return cls(
            trial=number,
            start_s=float(rng.uniform(begin, end - duration)),
            duration_s=duration,
            rise=float(rng.uniform(0.2, 0.5)),
            peak_N=float(size / np.sqrt(duration)),
            **vector("along", "m", direction(rng)),
            **vector("point", "m", near(ground.p_1c, REACH_M, rng)),
        )

    @abstractmethod
    def shape(self, share: float) -> float:
        """Force over its peak, at a share of the duration."""

    def actors(self, trial_number: int | None) -> Sequence[Actor]:
        if trial_number not in (None, self.trial):
            return []
        peak = self.peak_N * self.xyz("along")
        none = np.zeros(3)

        def force(time: float) -> np.ndarray:
            share = (time - self.start_s) / self.duration_s
            return peak * self.shape(share) if 0.0 <= share <= 1.0 else none

        return [PointForce(force, self.xyz("point"))]


@dataclass(frozen=True)
class RampPush(_ShapedPush):
    """It rises and falls in straight lines, each during a share ``rise`` of the duration."""

    def shape(self, share: float) -> float:
        return min(1.0, share / self.rise, (1.0 - share) / self.rise)


@dataclass(frozen=True)
class HalfSinePush(_ShapedPush):
    """Half a sine."""

    def shape(self, share: float) -> float:
        return math.sin(np.pi * share)


def in_every_trial(kind: type[Form], size: float, ground: Ground, rng: np.random.Generator) -> list[Form]:
    """One push in each trial that moves."""
    assert issubclass(kind, _ShapedPush)
    return [kind.drawn(size, ground, {}, rng, trial=number) for number, _, _ in ground.moving]
