"""Effects whose formula the diagnosis' dictionary does not have, written after its rules were frozen."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from mocobot_sim.trial.actors import RobotReadings
from sealed.forms.base import Place
from sealed.ground import Ground
from sealed.laws.hysteresis import BoucWen
from sealed.unlisted.misread import Error, Misread, MisreadNow
from sealed.unlisted.torques import _Torque

SCRATCH_RAD = 0.05
"""Width of a scratch on an encoder's disc."""
SOFT_NM = 8.0
"""Torque at which a soft saturation is half way."""
YIELD_NM = 0.4
"""Torque over which a loose gauge changes sides."""
SLACK_RAD = 0.03
"""Angle within which a hose hangs loose."""


@dataclass(frozen=True)
class ScratchedDisc(MisreadNow):
    """A driven joint's encoder errs where its disc is scratched, and nowhere else."""

    channel = "phi"
    size = "depth_rad"
    either_sign = True
    ranges: ClassVar = {"depth_rad": (-0.1, 0.1)}
    depth_rad: float
    at_rad: float

    @classmethod
    def others(cls, ground: Ground, place: Place, rng: np.random.Generator) -> dict[str, float]:
        return {"at_rad": float(rng.uniform(-0.1, 0.1))}

    def law(self) -> dict[str, Any]:
        return self._law(
            ["own phi, from home"], f"a exp(-((phi - {self.at_rad:.3g}) / {SCRATCH_RAD})^2)", "rad"
        )

    def error(self, readings: RobotReadings, seen: np.ndarray, value: float, time: float) -> float:
        return self.depth_rad * math.exp(-(((value - self.at_rad) / SCRATCH_RAD) ** 2))


@dataclass(frozen=True)
class SoftSaturation(MisreadNow):
    """A torque sensor that passes ever less of its torque, without a knee."""

    channel = "tau"
    size = "lost_share"
    ranges: ClassVar = {"lost_share": (0.0, 1.0)}
    lost_share: float

    def law(self) -> dict[str, Any]:
        return self._law(["own tau"], f"-a (tau - {SOFT_NM:g} tanh(tau / {SOFT_NM:g}))", "1")

    def error(self, readings: RobotReadings, seen: np.ndarray, value: float, time: float) -> float:
        return -self.lost_share * (value - SOFT_NM * math.tanh(value / SOFT_NM))


@dataclass(frozen=True)
class LooseBridge(Misread):
    """A torque sensor with the hysteresis of Bouc and Wen in its reading."""

    channel = "tau"
    size = "amplitude_Nm"
    ranges: ClassVar = {"amplitude_Nm": (0.0, 5.0)}
    amplitude_Nm: float

    def law(self) -> dict[str, Any]:
        return self._law(["own tau, its history"], f"a z(tau), Bouc-Wen over {YIELD_NM:g} N m", "N m")

    def error_of_trial(self) -> Error:
        wen, last = BoucWen(self.amplitude_Nm, YIELD_NM, 0.5, 1.0), [math.nan]

        def error(readings: RobotReadings, seen: np.ndarray, value: float, time: float) -> float:
            rate = 0.0 if math.isnan(last[0]) else value - last[0]
            last[0] = value
            return wen.step(rate, 1.0)

        return error


@dataclass(frozen=True)
class FineInterpolation(MisreadNow):
    """A gimbal encoder whose interpolation errs 64 times a turn."""

    channel = "theta"
    size = "amplitude_rad"
    ranges: ClassVar = {"amplitude_rad": (0.0, 0.1)}
    amplitude_rad: float
    phase_rad: float

    @classmethod
    def others(cls, ground: Ground, place: Place, rng: np.random.Generator) -> dict[str, float]:
        return {"phase_rad": float(rng.uniform(-np.pi, np.pi))}

    def law(self) -> dict[str, Any]:
        return self._law(["own theta"], f"a sin(64 theta + {self.phase_rad:.3g})", "rad")

    def error(self, readings: RobotReadings, seen: np.ndarray, value: float, time: float) -> float:
        return self.amplitude_rad * math.sin(64.0 * value + self.phase_rad)


@dataclass(frozen=True)
class SlackHose(_Torque):
    """A hose through a gimbal axis that hangs loose, then resists with the square of the angle."""

    kind = "gimbal"
    size = "square_Nm_per_rad2"
    ranges: ClassVar = {"square_Nm_per_rad2": (0.0, 1e4)}
    square_Nm_per_rad2: float

    def law(self) -> dict[str, Any]:
        return self._law("own theta", f"-a (theta beyond +-{SLACK_RAD:g}) |theta beyond|", "N m/rad^2")

    def torque(self, angle: float, rate: float, time: float) -> float:
        return -self.square_Nm_per_rad2 * math.copysign(max(abs(angle) - SLACK_RAD, 0.0) ** 2, angle)
