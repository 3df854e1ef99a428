"""Sensors that hold, drift or stand still: faults of the readings themselves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from mocobot_sim.trial.actors import RobotReadings
from sealed.forms.base import Form, Place
from sealed.ground import Ground
from sealed.unlisted.misread import Error, Misread, MisreadNow

HELD_S = (0.05, 0.2)
"""Shortest and longest time for which an encoder holds its last value."""


@dataclass(frozen=True)
class _Dropouts(Misread):
    """An encoder that holds its last value for a while, again and again; the controller gets the same."""

    size = "share"
    ranges: ClassVar = {"share": (0.0, 0.5), "draw": (0.0, 2.0**32)}
    share: float
    draw: float

    @classmethod
    def others(cls, ground: Ground, place: Place, rng: np.random.Generator) -> dict[str, float]:
        return {"draw": float(rng.integers(2**32))}

    def law(self) -> dict[str, Any]:
        return self._law([f"own {self.channel}, its history"], "the last value, held for a while", "1")

    def error_of_trial(self) -> Error:
        rng, mean_s = np.random.default_rng(int(self.draw)), 0.5 * sum(HELD_S)
        free_s = mean_s * (1.0 / self.share - 1.0)
        begin, until, held = float(rng.exponential(free_s)), 0.0, 0.0

        def error(readings: RobotReadings, seen: np.ndarray, value: float, time: float) -> float:
            nonlocal begin, until, held
            if time >= begin:
                until, held = begin + float(rng.uniform(*HELD_S)), value
                begin = until + float(rng.exponential(free_s))
            return held - value if time < until else 0.0

        return error


@dataclass(frozen=True)
class DropoutsPhi(_Dropouts):
    """A driven joint's encoder."""

    channel = "phi"


@dataclass(frozen=True)
class DropoutsTheta(_Dropouts):
    """A gimbal's encoder."""

    channel = "theta"


@dataclass(frozen=True)
class TorqueRamp(MisreadNow):
    """A torque sensor's zero drifts steadily, in every trial anew."""

    channel = "tau"
    size, either_sign = "rate_Nmps", True
    ranges: ClassVar = {"rate_Nmps": (-1.0, 1.0)}
    rate_Nmps: float

    def law(self) -> dict[str, Any]:
        return self._law(["t"], "a t", "N m/s")

    def error(self, readings: RobotReadings, seen: np.ndarray, value: float, time: float) -> float:
        return self.rate_Nmps * time


@dataclass(frozen=True)
class TorqueWalk(Misread):
    """A torque sensor's zero walks at random, each trial's way its own."""

    channel = "tau"
    size = "walk_Nm_per_sqrt_s"
    ranges: ClassVar = {"walk_Nm_per_sqrt_s": (0.0, 1.0), "draw": (0.0, 2.0**32)}
    walk_Nm_per_sqrt_s: float
    draw: float

    @classmethod
    def others(cls, ground: Ground, place: Place, rng: np.random.Generator) -> dict[str, float]:
        return {"draw": float(rng.integers(2**32))}

    def law(self) -> dict[str, Any]:
        return self._law(["t"], "a random walk", "N m/s^0.5")

    def error_of_trial(self) -> Error:
        rng, at, walked = np.random.default_rng(int(self.draw)), 0.0, 0.0

        def error(readings: RobotReadings, seen: np.ndarray, value: float, time: float) -> float:
            nonlocal at, walked
            walked += self.walk_Nm_per_sqrt_s * float(np.sqrt(time - at) * rng.standard_normal())
            at = time
            return walked

        return error


@dataclass(frozen=True)
class DeadBand(MisreadNow):
    """A torque sensor that does not answer to a change within a band around the torque at home, and to less beyond."""

    channel = "tau"
    size = "half_width_Nm"
    ranges: ClassVar = {"half_width_Nm": (0.0, 10.0), "centre_Nm": (-20.0, 20.0)}
    half_width_Nm: float
    centre_Nm: float

    @classmethod
    def drawn(cls, size: float, ground: Ground, place: Place, rng: np.random.Generator) -> Form:
        centre = float(ground.torque_Nm[place["robot"] - 1, place["joint"] - 1])
        return cls(**place, half_width_Nm=size, centre_Nm=centre)

    def law(self) -> dict[str, Any]:
        return self._law(
            ["own tau"], f"-(tau - {self.centre_Nm:.3g} N m), and beyond +-a no more than that", "N m"
        )

    def error(self, readings: RobotReadings, seen: np.ndarray, value: float, time: float) -> float:
        return -min(max(value - self.centre_Nm, -self.half_width_Nm), self.half_width_Nm)
