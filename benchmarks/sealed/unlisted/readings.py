"""Torque readings that are wrong."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from mocobot_sim.trial.actors import RobotReadings
from sealed.forms.base import Form, Place
from sealed.ground import Ground
from sealed.unlisted.misread import Gap, MisreadNow


@dataclass(frozen=True)
class _Torque(MisreadNow):
    channel = "tau"


@dataclass(frozen=True)
class CrossTalk(_Torque):
    """A torque sensor that also feels its neighbour's load."""

    size = "share"
    ranges: ClassVar = {"share": (-0.9, 0.9)}
    neighbour: float
    share: float

    @classmethod
    def drawn(cls, size: float, ground: Ground, place: Place, rng: np.random.Generator) -> Form:
        neighbour = rng.choice([k for k in (1, 2, 3) if k != place["joint"]])
        return cls(**place, neighbour=float(neighbour), share=float(rng.choice([-1.0, 1.0]) * size))

    def law(self) -> dict[str, Any]:
        other = int(self.neighbour)
        return self._law([f"tau of robot {self.robot}, joint {other}"], "a x", "1")

    def error(self, readings: RobotReadings, seen: np.ndarray, value: float, time: float) -> float:
        return self.share * readings.tau(seen, int(self.neighbour))


@dataclass(frozen=True)
class WarmingScale(_Torque):
    """Its scale drifts while the electronics warm up, in every trial anew."""

    size, either_sign = "scale", True
    ranges: ClassVar = {"scale": (-0.9, 0.9), "time_s": (0.1, 1e4)}
    scale: float
    time_s: float

    @classmethod
    def others(cls, ground: Ground, place: Place, rng: np.random.Generator) -> dict[str, float]:
        return {"time_s": float(rng.uniform(6.0, 20.0))}

    def law(self) -> dict[str, Any]:
        return self._law(["t", "own tau"], f"a tau (1 - exp(-t / {self.time_s:.3g} s))", "1")

    def error(self, readings: RobotReadings, seen: np.ndarray, value: float, time: float) -> float:
        return self.scale * (1.0 - math.exp(-time / self.time_s)) * value


@dataclass(frozen=True)
class WarmingZero(_Torque):
    """Its zero drifts with the temperature, in every trial anew."""

    size, either_sign = "zero_Nm", True
    ranges: ClassVar = {"zero_Nm": (-20.0, 20.0), "time_s": (0.1, 1e4)}
    zero_Nm: float
    time_s: float

    @classmethod
    def others(cls, ground: Ground, place: Place, rng: np.random.Generator) -> dict[str, float]:
        return {"time_s": float(rng.uniform(6.0, 20.0))}

    def law(self) -> dict[str, Any]:
        return self._law(["t"], f"a (1 - exp(-t / {self.time_s:.3g} s))", "N m")

    def error(self, readings: RobotReadings, seen: np.ndarray, value: float, time: float) -> float:
        return self.zero_Nm * (1.0 - math.exp(-time / self.time_s))


@dataclass(frozen=True)
class Saturation(_Torque):
    """Above a knee it passes a part of the torque only: an amplifier near its end."""

    size = "lost_share"
    ranges: ClassVar = {"knee_Nm": (0.0, 20.0), "lost_share": (0.0, 1.0)}
    knee_Nm: float
    lost_share: float

    @classmethod
    def drawn(cls, size: float, ground: Ground, place: Place, rng: np.random.Generator) -> Form:
        return cls(
            **place,
            knee_Nm=float(ground.torque_Nm[place["robot"] - 1, place["joint"] - 1]),
            lost_share=min(size, 1.0),
        )

    def law(self) -> dict[str, Any]:
        return self._law(["own tau"], f"-a max(tau - {self.knee_Nm:.3g} N m, 0)", "1")

    def error(self, readings: RobotReadings, seen: np.ndarray, value: float, time: float) -> float:
        return -self.lost_share * (max(value - self.knee_Nm, 0.0) + min(value + self.knee_Nm, 0.0))


@dataclass(frozen=True)
class QuadraticReading(_Torque):
    """Its scale grows with the load: a bridge that is not linear."""

    size, either_sign = "per_Nm", True
    ranges: ClassVar = {"per_Nm": (-0.05, 0.05)}
    per_Nm: float

    def law(self) -> dict[str, Any]:
        return self._law(["own tau"], "a tau^2", "1/(N m)")

    def error(self, readings: RobotReadings, seen: np.ndarray, value: float, time: float) -> float:
        return self.per_Nm * value**2


@dataclass(frozen=True)
class AngleInTorque(_Torque):
    """It feels where the joint stands: a cable that pulls at the sensor, once a turn."""

    size = "amplitude_Nm"
    ranges: ClassVar = {"amplitude_Nm": (0.0, 20.0)}
    amplitude_Nm: float
    times: float
    phase_rad: float

    @classmethod
    def others(cls, ground: Ground, place: Place, rng: np.random.Generator) -> dict[str, float]:
        return {"times": float(rng.integers(4, 13)), "phase_rad": float(rng.uniform(-np.pi, np.pi))}

    def law(self) -> dict[str, Any]:
        formula = f"a sin({self.times:.0f} phi + {self.phase_rad:.3g})"
        return self._law(["own phi, from home"], formula, "N m")

    def error(self, readings: RobotReadings, seen: np.ndarray, value: float, time: float) -> float:
        return self.amplitude_Nm * math.sin(self.times * readings.phi(seen, self.joint) + self.phase_rad)


@dataclass(frozen=True)
class TorqueBacklash(Gap):
    """It moves only once the torque has crossed a gap: a loose gauge, whose law is that of friction beside the spring.

    Either reading stays behind the torque by a number whose sign is that of its change.
    """

    answer = "sea_hysteresis"
    channel = "tau"
    size = "half_width_Nm"
    ranges: ClassVar = {"half_width_Nm": (0.0, 5.0)}
    half_width_Nm: float

    def known(self) -> dict[str, float]:
        return {"friction_Nm": self.half_width_Nm}

    def law(self) -> dict[str, Any] | None:
        return None


@dataclass(frozen=True)
class TorqueHum(_Torque):
    """A hum of one frequency on it, out of step with the motion."""

    size = "amplitude_Nm"
    ranges: ClassVar = {"amplitude_Nm": (0.0, 20.0), "frequency_hz": (0.01, 500.0)}
    amplitude_Nm: float
    frequency_hz: float

    @classmethod
    def others(cls, ground: Ground, place: Place, rng: np.random.Generator) -> dict[str, float]:
        return {"frequency_hz": float(rng.uniform(0.9, 3.5))}

    def law(self) -> dict[str, Any]:
        return self._law(["t"], f"a sin(2 pi {self.frequency_hz:.4g} Hz t)", "N m")

    def error(self, readings: RobotReadings, seen: np.ndarray, value: float, time: float) -> float:
        return self.amplitude_Nm * math.sin(2.0 * np.pi * self.frequency_hz * time)
