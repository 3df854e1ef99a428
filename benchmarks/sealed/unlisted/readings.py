"""Torque readings that are wrong."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from mocobot_sim.trial.actors import Reader
from mocobot_sim.trial.readings import Misreading, RobotReadings
from sealed.forms.base import Form, Place
from sealed.ground import Ground
from sealed.laws.hysteresis import Play


@dataclass(frozen=True)
class _TorqueReading(Form):
    """One torque reading is off by ``size`` times a function."""

    robot: int
    joint: int

    def _law(self, variables: list[str], formula: str, amplitude: float, unit: str) -> dict[str, Any]:
        place = {"robot": self.robot, "joint": self.joint}
        return {
            "place": place, "of": "tau reading", "variables": variables, "formula": formula, "amplitude": amplitude,
            "unit": unit,
        }  # fmt: skip

    def error(self, readings: RobotReadings, seen: np.ndarray, tau: float, time: float) -> float:
        """Reading minus truth [N m]."""
        raise NotImplementedError

    def readers(self, trial_number: int | None) -> Sequence[Reader]:
        def change(readings: RobotReadings, seen: np.ndarray, time: float) -> None:
            tau = readings.tau(seen, self.joint)
            readings.set_tau(seen, self.joint, tau + self.error(readings, seen, tau, time))

        return [Misreading(self.robot, change)]


@dataclass(frozen=True)
class CrossTalk(_TorqueReading):
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
        return self._law([f"tau of robot {self.robot}, joint {other}"], "a x", self.share, "1")

    def error(self, readings: RobotReadings, seen: np.ndarray, tau: float, time: float) -> float:
        return self.share * readings.tau(seen, int(self.neighbour))


@dataclass(frozen=True)
class WarmingScale(_TorqueReading):
    """Its scale drifts while the electronics warm up, in every trial anew."""

    size = "scale"
    ranges: ClassVar = {"scale": (-0.9, 0.9), "time_s": (0.1, 1e4)}
    scale: float
    time_s: float

    @classmethod
    def drawn(cls, size: float, ground: Ground, place: Place, rng: np.random.Generator) -> Form:
        return cls(**place, scale=float(rng.choice([-1.0, 1.0]) * size), time_s=float(rng.uniform(6.0, 20.0)))

    def law(self) -> dict[str, Any]:
        return self._law(["t", "own tau"], f"a tau (1 - exp(-t / {self.time_s:.3g} s))", self.scale, "1")

    def error(self, readings: RobotReadings, seen: np.ndarray, tau: float, time: float) -> float:
        return self.scale * (1.0 - math.exp(-time / self.time_s)) * tau


@dataclass(frozen=True)
class WarmingZero(_TorqueReading):
    """Its zero drifts with the temperature, in every trial anew."""

    size = "zero_Nm"
    ranges: ClassVar = {"zero_Nm": (-20.0, 20.0), "time_s": (0.1, 1e4)}
    zero_Nm: float
    time_s: float

    @classmethod
    def drawn(cls, size: float, ground: Ground, place: Place, rng: np.random.Generator) -> Form:
        return cls(
            **place, zero_Nm=float(rng.choice([-1.0, 1.0]) * size), time_s=float(rng.uniform(6.0, 20.0))
        )

    def law(self) -> dict[str, Any]:
        return self._law(["t"], f"a (1 - exp(-t / {self.time_s:.3g} s))", self.zero_Nm, "N m")

    def error(self, readings: RobotReadings, seen: np.ndarray, tau: float, time: float) -> float:
        return self.zero_Nm * (1.0 - math.exp(-time / self.time_s))


@dataclass(frozen=True)
class Saturation(_TorqueReading):
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
        return self._law(["own tau"], f"-a max(tau - {self.knee_Nm:.3g} N m, 0)", self.lost_share, "1")

    def error(self, readings: RobotReadings, seen: np.ndarray, tau: float, time: float) -> float:
        return -self.lost_share * (max(tau - self.knee_Nm, 0.0) + min(tau + self.knee_Nm, 0.0))


@dataclass(frozen=True)
class QuadraticReading(_TorqueReading):
    """Its scale grows with the load: a bridge that is not linear."""

    size = "per_Nm"
    ranges: ClassVar = {"per_Nm": (-0.05, 0.05)}
    per_Nm: float

    @classmethod
    def drawn(cls, size: float, ground: Ground, place: Place, rng: np.random.Generator) -> Form:
        return cls(**place, per_Nm=float(rng.choice([-1.0, 1.0]) * size))

    def law(self) -> dict[str, Any]:
        return self._law(["own tau"], "a tau^2", self.per_Nm, "1/(N m)")

    def error(self, readings: RobotReadings, seen: np.ndarray, tau: float, time: float) -> float:
        return self.per_Nm * tau**2


@dataclass(frozen=True)
class AngleInTorque(_TorqueReading):
    """It feels where the joint stands: a cable that pulls at the sensor, once a turn."""

    size = "amplitude_Nm"
    ranges: ClassVar = {"amplitude_Nm": (0.0, 20.0)}
    amplitude_Nm: float
    times: float
    phase_rad: float

    @classmethod
    def drawn(cls, size: float, ground: Ground, place: Place, rng: np.random.Generator) -> Form:
        times, phase = float(rng.integers(4, 13)), float(rng.uniform(-np.pi, np.pi))
        return cls(**place, amplitude_Nm=size, times=times, phase_rad=phase)

    def law(self) -> dict[str, Any]:
        formula = f"a sin({self.times:.0f} phi + {self.phase_rad:.3g})"
        return self._law(["own phi, from home"], formula, self.amplitude_Nm, "N m")

    def error(self, readings: RobotReadings, seen: np.ndarray, tau: float, time: float) -> float:
        return self.amplitude_Nm * math.sin(self.times * readings.phi(seen, self.joint) + self.phase_rad)


@dataclass(frozen=True)
class TorqueBacklash(_TorqueReading):
    """It moves only once the torque has crossed a gap: a loose gauge."""

    size = "half_width_Nm"
    ranges: ClassVar = {"half_width_Nm": (0.0, 5.0)}
    half_width_Nm: float

    @classmethod
    def drawn(cls, size: float, ground: Ground, place: Place, rng: np.random.Generator) -> Form:
        return cls(**place, half_width_Nm=size)

    def law(self) -> dict[str, Any]:
        return self._law(["own tau, its history"], "play of half width a", self.half_width_Nm, "N m")

    def readers(self, trial_number: int | None) -> Sequence[Reader]:
        play = Play(self.half_width_Nm)

        def change(readings: RobotReadings, seen: np.ndarray, time: float) -> None:
            readings.set_tau(seen, self.joint, play.step(readings.tau(seen, self.joint)))

        return [Misreading(self.robot, change)]


@dataclass(frozen=True)
class TorqueHum(_TorqueReading):
    """A hum of one frequency on it, out of step with the motion."""

    size = "amplitude_Nm"
    ranges: ClassVar = {"amplitude_Nm": (0.0, 20.0), "frequency_hz": (0.01, 500.0)}
    amplitude_Nm: float
    frequency_hz: float

    @classmethod
    def drawn(cls, size: float, ground: Ground, place: Place, rng: np.random.Generator) -> Form:
        return cls(**place, amplitude_Nm=size, frequency_hz=float(rng.uniform(0.9, 3.5)))

    def law(self) -> dict[str, Any]:
        return self._law(["t"], f"a sin(2 pi {self.frequency_hz:.4g} Hz t)", self.amplitude_Nm, "N m")

    def error(self, readings: RobotReadings, seen: np.ndarray, tau: float, time: float) -> float:
        return self.amplitude_Nm * math.sin(2.0 * np.pi * self.frequency_hz * time)
