"""Angle readings that are wrong."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from mocobot_sim.trial.actors import RobotReadings
from sealed.forms.base import Place
from sealed.ground import Ground
from sealed.unlisted.misread import Gap, MisreadNow


@dataclass(frozen=True)
class _Eccentric(MisreadNow):
    size = "amplitude_rad"
    ranges: ClassVar = {"amplitude_rad": (0.0, 0.5)}
    amplitude_rad: float
    phase_rad: float
    times: ClassVar[int]

    @classmethod
    def others(cls, ground: Ground, place: Place, rng: np.random.Generator) -> dict[str, float]:
        return {"phase_rad": float(rng.uniform(-np.pi, np.pi))}

    def law(self) -> dict[str, Any]:
        times = "" if self.times == 1 else f"{self.times} "
        formula = f"a sin({times}{self.channel} + {self.phase_rad:.3g})"
        return self._law([f"own {self.channel}, from home"], formula, "rad")

    def error(self, readings: RobotReadings, seen: np.ndarray, value: float, time: float) -> float:
        return self.amplitude_rad * math.sin(self.times * value + self.phase_rad)


@dataclass(frozen=True)
class EccentricPhi(_Eccentric):
    """A driven joint's encoder disc sits off its axis."""

    channel = "phi"
    times = 1


@dataclass(frozen=True)
class EccentricTheta(_Eccentric):
    """A gimbal encoder's disc sits off its axis."""

    channel = "theta"
    times = 1


@dataclass(frozen=True)
class CyclicPhi(_Eccentric):
    """An error that comes again with every pole of a magnetic encoder."""

    channel = "phi"
    times = 16


@dataclass(frozen=True)
class EncoderBacklash(Gap):
    """A driven joint's encoder sits behind a gear with play."""

    channel = "phi"
    size = "half_width_rad"
    ranges: ClassVar = {"half_width_rad": (0.0, 0.1)}
    half_width_rad: float


@dataclass(frozen=True)
class SoftEncoderMount(MisreadNow):
    """A driven joint's encoder gives way to the joint's torque."""

    channel = "phi"
    size, either_sign = "rad_per_Nm", True
    ranges: ClassVar = {"rad_per_Nm": (-0.1, 0.1)}
    rad_per_Nm: float

    def law(self) -> dict[str, Any]:
        return self._law(["own tau"], "a tau", "rad/(N m)")

    def error(self, readings: RobotReadings, seen: np.ndarray, value: float, time: float) -> float:
        return self.rad_per_Nm * readings.tau(seen, self.joint)


@dataclass(frozen=True)
class SlippingZero(MisreadNow):
    """A gimbal encoder's zero slips steadily, in every trial anew."""

    channel = "theta"
    size, either_sign = "rate_radps", True
    ranges: ClassVar = {"rate_radps": (-0.1, 0.1)}
    rate_radps: float

    def law(self) -> dict[str, Any]:
        return self._law(["t"], "a t", "rad/s")

    def error(self, readings: RobotReadings, seen: np.ndarray, value: float, time: float) -> float:
        return self.rate_radps * time
