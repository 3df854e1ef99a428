"""Angle readings that are wrong."""

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
class _AngleReading(Form):
    """One angle reading is off."""

    angle: ClassVar[str]
    robot: int
    joint: int

    def _law(self, variables: list[str], formula: str, amplitude: float, unit: str) -> dict[str, Any]:
        place = {"robot": self.robot, "joint": self.joint}
        return {
            "place": place, "of": f"{self.angle} reading", "variables": variables, "formula": formula,
            "amplitude": amplitude, "unit": unit,
        }  # fmt: skip

    def error(self, readings: RobotReadings, seen: np.ndarray, angle: float, time: float) -> float:
        """Reading minus truth [rad]."""
        raise NotImplementedError

    def readers(self, trial_number: int | None) -> Sequence[Reader]:
        phi = self.angle == "phi"

        def change(readings: RobotReadings, seen: np.ndarray, time: float) -> None:
            angle = (readings.phi if phi else readings.theta)(seen, self.joint)
            add = readings.add_phi if phi else readings.add_theta
            add(seen, self.joint, self.error(readings, seen, angle, time))

        return [Misreading(self.robot, change)]


@dataclass(frozen=True)
class _Eccentric(_AngleReading):
    size = "amplitude_rad"
    ranges: ClassVar = {"amplitude_rad": (0.0, 0.5)}
    amplitude_rad: float
    phase_rad: float
    times: ClassVar[int]

    @classmethod
    def drawn(cls, size: float, ground: Ground, place: Place, rng: np.random.Generator) -> Form:
        return cls(**place, amplitude_rad=size, phase_rad=float(rng.uniform(-np.pi, np.pi)))

    def law(self) -> dict[str, Any]:
        times = "" if self.times == 1 else f"{self.times} "
        formula = f"a sin({times}{self.angle} + {self.phase_rad:.3g})"
        return self._law([f"own {self.angle}, from home"], formula, self.amplitude_rad, "rad")

    def error(self, readings: RobotReadings, seen: np.ndarray, angle: float, time: float) -> float:
        return self.amplitude_rad * math.sin(self.times * angle + self.phase_rad)


@dataclass(frozen=True)
class EccentricPhi(_Eccentric):
    """A driven joint's encoder disc sits off its axis."""

    angle = "phi"
    times = 1


@dataclass(frozen=True)
class EccentricTheta(_Eccentric):
    """A gimbal encoder's disc sits off its axis."""

    angle = "theta"
    times = 1


@dataclass(frozen=True)
class CyclicPhi(_Eccentric):
    """An error that comes again with every pole of a magnetic encoder."""

    angle = "phi"
    times = 16


@dataclass(frozen=True)
class EncoderBacklash(_AngleReading):
    """A driven joint's encoder sits behind a gear with play."""

    angle = "phi"
    size = "half_width_rad"
    ranges: ClassVar = {"half_width_rad": (0.0, 0.1)}
    half_width_rad: float

    @classmethod
    def drawn(cls, size: float, ground: Ground, place: Place, rng: np.random.Generator) -> Form:
        return cls(**place, half_width_rad=size)

    def law(self) -> dict[str, Any]:
        return self._law(["own phi, its history"], "play of half width a", self.half_width_rad, "rad")

    def readers(self, trial_number: int | None) -> Sequence[Reader]:
        play = Play(self.half_width_rad)

        def change(readings: RobotReadings, seen: np.ndarray, time: float) -> None:
            phi = readings.phi(seen, self.joint)
            readings.add_phi(seen, self.joint, play.step(phi) - phi)

        return [Misreading(self.robot, change)]


@dataclass(frozen=True)
class SoftEncoderMount(_AngleReading):
    """A driven joint's encoder gives way to the joint's torque."""

    angle = "phi"
    size = "rad_per_Nm"
    ranges: ClassVar = {"rad_per_Nm": (-0.1, 0.1)}
    rad_per_Nm: float

    @classmethod
    def drawn(cls, size: float, ground: Ground, place: Place, rng: np.random.Generator) -> Form:
        return cls(**place, rad_per_Nm=float(rng.choice([-1.0, 1.0]) * size))

    def law(self) -> dict[str, Any]:
        return self._law(["own tau"], "a tau", self.rad_per_Nm, "rad/(N m)")

    def error(self, readings: RobotReadings, seen: np.ndarray, angle: float, time: float) -> float:
        return self.rad_per_Nm * readings.tau(seen, self.joint)


@dataclass(frozen=True)
class SlippingZero(_AngleReading):
    """A gimbal encoder's zero slips steadily, in every trial anew."""

    angle = "theta"
    size = "rate_radps"
    ranges: ClassVar = {"rate_radps": (-0.1, 0.1)}
    rate_radps: float

    @classmethod
    def drawn(cls, size: float, ground: Ground, place: Place, rng: np.random.Generator) -> Form:
        return cls(**place, rate_radps=float(rng.choice([-1.0, 1.0]) * size))

    def law(self) -> dict[str, Any]:
        return self._law(["t"], "a t", self.rate_radps, "rad/s")

    def error(self, readings: RobotReadings, seen: np.ndarray, angle: float, time: float) -> float:
        return self.rate_radps * time
